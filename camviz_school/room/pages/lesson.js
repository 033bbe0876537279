// A lesson's page that a room serves: join at its foot, and its questions vote in the room. Which vote is open, and whether
// a choice counts, is what the room says; what the page keeps of a vote, it keeps after the reveal.

import { NOT_REACHED, OVER, STORED, joined, left, recalled, remember } from "./membership.js";
import { Refused, ask, element, follow, share, sum } from "./room.js";

const asked = [...document.querySelectorAll(".camviz-asked")].map((place) => {
  const { questions, lesson } = JSON.parse(place.querySelector("script").textContent);
  return { place, lesson, names: questions.map(({ name }) => name) };
});
const names = asked.flatMap((one) => one.names);
const room = new URL("../", import.meta.url).href;
const news = element("p", { role: "status", class: "news" }), body = element("div");
let membership = recalled(), latest = null, following = 0;
const pending = {}; // by question, this student's choices, until the page may keep them
const unfolded = new Set(); // questions whose folded section was opened for them
const problems = {}; // by question, why the last choice was not counted

const say = (...words) => news.replaceChildren(...words);
const letter = (choice) => `(${"abcdefgh"[choice]})`;
const which = (round) => (round === 1 ? "first" : "second");
const refresh = () => document.dispatchEvent(new Event("camviz-room"));

// What the room says of a question while its reply has to wait; null for all others.
function waiting(name) {
  const told = toldOf(name);
  return told && !told.revealed && !told.kept ? told : null;
}

function toldOf(name) {
  if (!latest) return null;
  return (latest.questions ?? [latest.question]).find((one) => one?.name === name) ?? null;
}

const choices = (told) => Object.keys(told.chosen).sort().map((round) => told.chosen[round]);

function card({ name }) {
  const told = waiting(name);
  if (!told) return null;
  const chosen = told.open ? told.chosen[told.open] : choices(told).at(-1);
  const voting = Boolean(told.open);
  const reply = document.createElement("p");
  reply.textContent = problems[name] ?? state(told, chosen);
  return { chosen: chosen ?? null, tries: chosen === undefined ? 0 : 1, correct: null, earlier: false, reply: reply.outerHTML, voting, held: !voting };
}

function state(told, chosen) {
  const home = latest.at_home, kind = home ? "answer" : "vote";
  const own = chosen === undefined ? "You did not vote." : `You chose ${letter(chosen)}.`;
  if (!told.open) return told.rounds.length ? `The vote is closed. ${own} ${told.discuss}` : "The vote has not begun.";
  if (chosen !== undefined) return `Your ${which(told.open)} vote is ${letter(chosen)}. It is counted. You may change it until the vote is closed.`;
  if (told.open === 2) return `This is the second ${kind}. ${told.chosen[1] === undefined ? "" : `You chose ${letter(told.chosen[1])}. `}${told.discuss}`;
  return `This is the first ${kind}. Your choice goes to the room, and the reply comes ${home ? "after your second answer" : "when your teacher shows it"}.`;
}

async function send({ name }, choice) {
  const round = waiting(name).open;
  try {
    show(await ask("api/vote", membership.token, { question: name, round, choice }));
  } catch (error) {
    problems[name] = error instanceof Refused ? error.message : "Your vote was not sent: no connection to the room. Try again.";
    refresh();
  }
}

// The class's shares, once they are revealed.
function said(questions) {
  return questions.map(({ name }) => {
    const told = toldOf(name);
    if (!told?.revealed || !Object.keys(told.counts).length) return "";
    const shares = Object.entries(told.counts).map(([round, counts]) => `${share(counts[told.answer], sum(counts))} % in the ${which(Number(round))} vote`);
    return `Your class chose the right answer: ${shares.join(", ")}.`;
  }).join(" ");
}

// A student's choices of a vote that is over, once, for the page to keep as answers.
function settled({ name }, kept) {
  if (waiting(name)) return [];
  const told = toldOf(name), seen = pending[name];
  delete pending[name];
  if (!seen && kept.length) return [];
  return told ? choices(told) : seen ?? [];
}

function show(told) {
  latest = told;
  for (const name of names) {
    const one = waiting(name);
    if (one && choices(one).length) pending[name] = choices(one);
    delete problems[name];
  }
  if (told.ended) return over("The room has ended. Your number is deleted from this browser.");
  point(told);
  refresh();
  return undefined;
}

function point(told) {
  const open = (told.questions ?? [told.question]).filter((one) => one?.open);
  const here = open.find(({ name }) => names.includes(name));
  unfold(open);
  const link = (words, href) => element("a", { href }, words);
  if (told.at_home) say("The questions are open at home. Answer each twice; then you read why.");
  else if (here) say("The class votes on a question of this page: ", link("go to the question", `#${place(here.name)}`), ".");
  else if (open.length) say("The class votes on a question that is not on this page: ", link("go there", told.read ? room + told.read : room), ".");
  else if (told.question) say(link(words(told.question), names.includes(told.question.name) ? `#${place(told.question.name)}` : room), ".");
  else say("You are in. The next question comes when the teacher asks it.");
}

// A folded section in which something is asked opens once; who closes it again leaves it closed.
function unfold(questions) {
  for (const { name } of questions.filter((one) => !unfolded.has(one.name))) {
    const fold = asked.find((one) => one.names.includes(name))?.place.closest("details.camviz-deeper");
    unfolded.add(name);
    if (fold) fold.open = true;
  }
}

function words({ revealed, rounds }) {
  if (revealed) return "The answer is shown";
  return rounds.length ? "The vote is closed; talk about this question" : "The next vote is on this question";
}

function place(name) {
  const found = asked.find((one) => one.names.includes(name)).place;
  found.id ||= `asked-${name.replace(/\W/g, "-")}`;
  return found.id;
}

function enter() {
  const mine = ++following;
  document.documentElement.classList.add("camviz-joined");
  body.replaceChildren(element("button", { type: "button", on: { click: leave } }, "Leave the room"));
  follow(membership.token, {
    show: (told) => { if (mine === following) show(told); },
    lost: (sentence) => { if (sentence) say(sentence); else if (latest) point(latest); },
    gone: ({ status, message }) => {
      if (mine === following && OVER.includes(status)) over(status === 410 ? "The room has ended." : message);
      return mine !== following || OVER.includes(status);
    },
  });
}

function over(sentence) {
  following += 1;
  remember(membership = latest = null);
  document.documentElement.classList.remove("camviz-joined");
  refresh();
  door(sentence);
}

async function leave() {
  const gone = membership;
  over("You have left the room. What you voted still counts.");
  await left(gone);
}

function door(sentence = "") {
  const word = element("input", { id: "camviz-word", autocomplete: "off", autocapitalize: "none", spellcheck: "false", required: true, placeholder: "prism-0000" });
  const submit = async (event) => {
    event.preventDefault();
    try {
      membership = await joined(word.value);
      enter();
    } catch (error) {
      say(error instanceof Refused ? error.message : NOT_REACHED);
    }
  };
  body.replaceChildren(element("details", { open: Boolean(sentence) && body.querySelector("details[open]") !== null },
    element("summary", {}, "Vote with your class"),
    element("form", { on: { submit } }, element("label", { for: "camviz-word" }, "The word of the room, from the projector"), word, element("button", { type: "submit" }, "Join")),
    element("p", { class: "kept" }, STORED)));
  say(sentence);
}

Object.assign(window.camvizClassroom, { card, send, said, settled });
document.body.append(element("aside", { class: "camviz-class", "aria-label": "Your class's room" }, news, body));
if (membership) enter();
else door();
