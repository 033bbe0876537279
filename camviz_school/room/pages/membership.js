// What lets a browser vote: a random number, kept in this tab until the room ends. The telephone's page and the lessons'
// pages of a room share it.

import { ask } from "./room.js";

const KEPT = "camviz-room";

export const STORED = "Only your choice is sent. It is kept under a random number in a file on the teacher's computer, "
  + "until the teacher deletes that file. No name, no address, no time and no cookie is kept. What joins this browser to "
  + "the number is deleted here and there when the room ends.";

export const NOT_REACHED = "The room is not reached. Are you in the right network?";

export const OVER = [401, 410]; // what a server answers to a number that it does not know, or not any more

export function recalled() {
  const kept = JSON.parse(sessionStorage.getItem(KEPT) ?? "null");
  return kept && kept.ends * 1000 > Date.now() ? kept : null;
}

export function remember(membership) {
  if (membership) sessionStorage.setItem(KEPT, JSON.stringify(membership));
  else sessionStorage.removeItem(KEPT);
}

export async function joined(word) {
  const membership = await ask("api/join", null, { word });
  remember(membership);
  return membership;
}

// Forget the number here and there. Here it is gone, whoever hears of it.
export async function left({ token }) {
  remember(null);
  await ask("api/join", token, undefined, "DELETE").catch(() => {});
}
