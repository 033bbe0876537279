// A student's page: join, vote, talk, vote again, read why. It keeps one random number, in this tab, until the room ends.

import { NOT_REACHED, OVER, STORED, joined, left, recalled, remember } from "./membership.js";
import { Refused, ask, bars, element, follow } from "./room.js";

const content = document.getElementById("content"), news = document.getElementById("news");
const picked = {}; // by question and round, what is marked and not sent yet
let membership = recalled(), shown = "", latest = null, following = 0;

const say = (sentence) => { if (news.textContent !== sentence) news.textContent = sentence; };

function privacy(until) {
  const end = until ? ` The room ends by itself on ${until}, at the latest.` : "";
  document.getElementById("kept").textContent = `${STORED}${end}`;
}

function door(problem = "") {
  const word = element("input", { id: "word", value: decodeURIComponent(location.hash.slice(1)), autocomplete: "off",
    autocapitalize: "none", spellcheck: "false", required: true, placeholder: "prism-0000" });
  const form = element("form", { class: "door", on: { submit: (event) => { event.preventDefault(); join(word.value); } } },
    element("label", { for: "word" }, "The word of the room, from the projector"), word,
    element("button", { class: "main", type: "submit" }, "Join"));
  content.replaceChildren(form);
  shown = "";
  say(problem);
  privacy("");
}

async function join(word) {
  try {
    membership = await joined(word);
    history.replaceState(null, "", location.pathname);
    enter();
  } catch (error) {
    say(error instanceof Refused ? error.message : NOT_REACHED);
  }
}

function enter() {
  const mine = ++following, { token } = membership;
  follow(token, {
    show: (told) => { if (mine === following) show(told); },
    lost: say,
    gone: ({ status, message }) => {
      if (mine !== following) return true;
      if (OVER.includes(status)) over(status === 410 ? "" : message);
      return OVER.includes(status);
    },
  });
}

function over(problem = "") {
  following += 1;
  remember(membership = null);
  if (problem) return door(problem);
  content.replaceChildren(element("p", {}, "Your number is deleted from this browser. Thank you for thinking along."));
  say("The room has ended.");
  privacy("");
}

async function leave() {
  following += 1;
  await left(membership);
  membership = null;
  door("You have left the room. What you voted still counts.");
}

async function vote(question, round, choice) {
  try {
    show(await ask("api/vote", membership.token, { question, round, choice }));
    say("Your vote is counted.");
  } catch (error) {
    say(error instanceof Refused ? error.message : "Your vote was not sent: no connection to the room. Try again.");
  }
}

function show(told) {
  latest = told;
  const now = JSON.stringify([told.question, told.questions, told.at_home, told.ended, told.read]);
  if (told.ended) return over();
  if (now === shown) return undefined;
  shown = now;
  privacy(told.until);
  say("");
  const held = document.activeElement?.id;
  const cards = told.at_home ? told.questions.map((one) => card(one, true)) : told.question ? [card(told.question, false)] : [];
  const lead = told.at_home ? "These questions are open at home. Answer each twice; then you read why."
    : cards.length ? "" : "You are in. The next question comes when the teacher asks it.";
  const read = told.read && element("p", { class: "read" },
    element("a", { href: told.read }, told.question ? "Read the lesson, and vote there" : "Read the lessons"));
  content.replaceChildren(element("p", { class: "lead" }, lead), ...cards, read,
    element("button", { class: "quiet", type: "button", on: { click: leave } }, "Leave the room"));
  if (held) document.getElementById(held)?.focus();
  return undefined;
}

function card(question, atHome) {
  const node = element("section", { class: "card" });
  if (question.discuss) node.append(element("p", { class: "discuss" }, element("strong", {}, talk(question, atHome)), question.discuss));
  node.append(question.revealed || !question.open ? closed(question, atHome) : ballot(question, atHome));
  return node;
}

const letter = (question, choice) => `(${question.letters[choice]})`;

function talk(question, atHome) {
  const first = question.chosen[1];
  if (first === undefined) return "Talk about it. ";
  return atHome ? `You chose ${letter(question, first)}. ` : `You chose ${letter(question, first)}. Find somebody who did not. `;
}

function ballot(question, atHome) {
  const round = question.open, place = `${question.name}-${round}`, cast = question.chosen[round];
  const id = place.replace(/\W/g, "-");
  const button = element("button", { class: "main", type: "submit", id: `${id}-vote` }, cast === undefined ? "Vote" : "Change my vote");
  const chosen = () => picked[place] ?? cast;
  const refresh = () => { button.disabled = chosen() === undefined || chosen() === cast; };
  const rows = question.choices.map((choice, index) => {
    const radio = element("input", { type: "radio", name: id, value: index, id: `${id}-${index}`, checked: chosen() === index,
      on: { change: () => { picked[place] = index; refresh(); } } });
    return element("label", { class: "choice" }, radio, element("span", { class: "letter" }, letter(question, index)), element("span", { html: choice }));
  });
  refresh();
  const which = { 1: atHome ? "First answer" : "First vote", 2: atHome ? "Second answer" : "Second vote" }[round];
  const state = cast === undefined ? "" : ` Your vote is ${letter(question, cast)}. You may change it until the vote is closed.`;
  return element("form", { on: { submit: (event) => { event.preventDefault(); if (!button.disabled) vote(question.name, round, chosen()); } } },
    element("fieldset", {}, element("legend", { html: question.text }), ...rows),
    element("p", { class: "state" }, element("strong", {}, `${which}.`), state), button);
}

function closed(question, atHome) {
  const own = Object.entries(question.chosen).map(([round, choice]) => `${letter(question, choice)} in the ${round === "1" ? "first" : "second"} vote`).join(", ");
  const state = question.revealed ? (own ? `You chose ${own}.` : "You did not vote.")
    : question.kept ? `Kept: ${own}. The answer comes with the quiz after the lesson.`
    : question.rounds.length ? `The vote is closed. ${own ? `You chose ${own}.` : "You did not vote."}` : "The vote has not begun.";
  const rows = question.choices.map((choice, index) => {
    const right = question.revealed && index === question.answer;
    const reply = question.revealed && question.replies[index];
    return element("li", { class: right ? "right" : "" },
      element("span", {}, `${right ? "✓ " : ""}${letter(question, index)} `), element("span", { html: choice }),
      question.revealed && !atHome ? bars(question.counts, index, question.chosen) : "",
      reply ? element("div", { class: "reply", html: reply }) : "");
  });
  return element("div", {}, element("div", { class: "asked", html: question.text }),
    element("p", { class: "state" }, state), element("ul", { class: "choices" }, ...rows));
}

if (membership) enter();
else door();
