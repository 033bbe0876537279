// The teacher's own screen: which question, when a vote opens and closes, what is behind each bar, and what to say.

import { Refused, ask, bars, element, follow, haveJoined } from "./room.js";

const key = location.hash.slice(1);
const [content, news, door, list, kept] = ["content", "news", "door", "questions", "kept"].map((id) => document.getElementById(id));
const entries = {}; // by question, what shows its state
let room = null, shown = "";

const say = (sentence) => { if (news.textContent !== sentence) news.textContent = sentence; };

async function act(deed, question = "", number = 0) {
  try {
    show(await ask("api/do", key, { do: deed, question, number }));
  } catch (error) {
    say(error instanceof Refused ? error.message : "No connection to the room's server. Is camviz class still running?");
  }
}

const button = (words, click, options = {}) => element("button", { type: "button", on: { click }, ...options }, words);

async function save(which) {
  try {
    const answer = await fetch(`api/${which}.csv`, { headers: { Authorization: `Bearer ${key}` } });
    if (!answer.ok) throw new Error(`The server says ${answer.status}.`);
    const link = element("a", { href: URL.createObjectURL(await answer.blob()), download: `${which}_${room.word}.csv` });
    link.click();
    URL.revokeObjectURL(link.href);
  } catch (error) {
    say(`Nothing was written. ${error.message}`);
  }
}

function doorShown(told) {
  const projector = element("a", { href: `projector#${room.projector}`, target: "_blank", rel: "noopener" }, "Open the projector's page");
  const site = room.site && element("a", { href: room.site, target: "_blank", rel: "noopener" }, "Open the lessons");
  const home = button(told.at_home ? "Close the questions at home" : "Open all questions at home",
    () => act(told.at_home ? "close at home" : "open at home"), { id: "home", disabled: told.ended });
  const end = button("End the room", () => {
    if (confirm("End the room? Nobody can vote any more, and what joins browsers to votes is deleted. The votes stay in their file.")) act("end");
  }, { id: "end", disabled: told.ended });
  door.replaceChildren(
    ...(room.qr ? [element("img", { class: "qr", src: room.qr, alt: "QR code of the address with the word" })] : []),
    element("p", {}, element("span", { class: "address" }, room.address), element("strong", { class: "word" }, room.word),
      element("span", { class: "joined" }, haveJoined(told.joined))),
    element("div", { class: "tools" }, projector, site, home,
      button("Votes as CSV", () => save("counts"), { id: "counts" }),
      button("Answers as CSV, for the gain", () => save("answers"), { id: "answers" }), end));
}

function listQuestions() {
  list.replaceChildren(...room.lessons.map(({ lesson, title, questions }) => element("details", { open: room.lessons.length === 1 && innerWidth > 800 },
    element("summary", {}, `${lesson} ${title}`),
    element("ul", {}, ...questions.map((one) => {
      const state = element("span", { class: "state" });
      entries[one.name] = { state, button: button("", () => act("choose", one.name)) };
      entries[one.name].button.append(element("span", { class: "kind" }, one.kind), element("span", { class: "short" }, one.text), state);
      return element("li", {}, entries[one.name].button);
    })))));
}

function steps(question) {
  const { name, open, revealed, rounds, form } = question, twice = rounds.length > 1;
  const step = (words, deed, number, main) => button(words, () => act(deed, name, number), { class: main ? "main" : "", id: `${deed}-${number}` });
  if (revealed) return [];
  if (open) return [step(open === 1 ? "Close the first vote" : "Close the second vote", "close", 0, true)];
  if (!rounds.length) return [step("Open the vote", "open", 1, true)];
  const again = step(`Open vote ${twice ? 2 : 1} again`, "open", twice ? 2 : 1, false);
  if (form === "A") return [again];
  return [...(twice ? [] : [step("Open the second vote", "open", 2, true)]), step("Reveal the answer", "reveal", 0, twice), again];
}

function gainOf(question, index) {
  if (!question.gains) return "";
  const value = question.gains[index];
  const [named, none] = question.behind[index].correct
    ? ["gain", "no gain: everyone was right at first"] : ["gain on this misconception", "no gain: nobody thought so at first"];
  return element("p", { class: "gain" }, value === null ? none : `${named}: ${value.toFixed(2)}`);
}

function row(question, index) {
  const { correct, misconception, reply } = question.behind[index];
  const pointed = question.revealed && question.pointed === index;
  const point = question.revealed ? button(pointed ? "On the projector" : "Show this reply on the projector", () => act("point", question.name, index), { id: `point-${index}`, disabled: pointed }) : "";
  return element("li", { class: correct ? "right" : "" },
    element("p", { class: "text" }, `${correct ? "✓ " : ""}(${question.letters[index]}) `, element("span", { html: question.choices[index] })),
    Object.keys(question.counts).length ? bars(question.counts, index) : "",
    element("p", { class: "behind" }, correct ? "the right answer" : `behind it: ${misconception}`), gainOf(question, index),
    element("details", { "data-choice": index }, element("summary", {}, "What to say"), element("div", { html: reply })), point);
}

function howMany(told, question) {
  return question.rounds.map(({ round, voted }) => `Vote ${round}: ${voted} of ${told.joined}${question.open === round ? " so far, open" : ", closed"}`).join(" · ");
}

function questionShown(told) {
  const question = told.question;
  if (told.at_home) return [atHome(told)];
  if (!question) return [element("p", {}, "Choose a question. Nobody sees an answer before you reveal it.")];
  const gains = question.gains ? element("p", { class: "formula" }, `The gains are of the ${question.twice} who voted twice. Gain = (after − before) / (1 − before), `
    + "where before and after are the shares with the right answer, and for a misconception the shares without it "
    + "(Hake, American Journal of Physics 66, 1998, 64–74).") : "";
  return [element("div", { class: "steps" }, ...steps(question)),
    element("p", { class: "many" }, howMany(told, question)),
    question.advice ? element("p", { class: "advice" }, question.advice) : "",
    question.discuss ? element("p", { class: "discuss" }, element("strong", {}, "On the projector: "), question.discuss) : "",
    form(question),
    element("div", { class: "asked", html: question.text }),
    element("ul", { class: "choices" }, ...question.choices.map((_, index) => row(question, index))), gains];
}

function form(question) {
  return question.form === "A" ? element("p", { class: "advice" }, "Form A is asked before the lesson. It has one vote, and its answers come with form B.") : "";
}

function atHome(told) {
  const rows = Object.entries(told.answered).map(([name, [first, second]]) => element("tr", {}, element("th", { scope: "row" }, name), element("td", {}, `${first}`), element("td", {}, `${second}`)));
  return element("table", {}, element("caption", {}, "Open at home: how many have answered. The splits come when you close them."),
    element("thead", {}, element("tr", {}, ...["question", "first", "second"].map((each) => element("th", { scope: "col" }, each)))), element("tbody", {}, ...rows));
}

function show(told) {
  const now = JSON.stringify({ ...told, state: "" });
  if (now === shown) return;
  shown = now;
  const held = document.activeElement?.id;
  const unfolded = [...content.querySelectorAll("details[open]")].map((one) => one.dataset.choice);
  const before = content.dataset.question;
  doorShown(told);
  say(told.ended ? "The room has ended. The votes stay in their file until you delete it." : "");
  content.dataset.question = told.question?.name ?? "";
  content.replaceChildren(...questionShown(told));
  if (before === content.dataset.question) unfolded.forEach((index) => content.querySelector(`details[data-choice="${index}"]`)?.setAttribute("open", ""));
  for (const [name, { state, button: entry }] of Object.entries(entries)) {
    state.textContent = told.states[name];
    if (told.question?.name === name) entry.setAttribute("aria-current", "true");
    else entry.removeAttribute("aria-current");
  }
  kept.textContent = `Kept in ${room.file} on this computer, readable by you alone: each choice under a random number, and no name, address or time. `
    + `The room ends by itself on ${told.until}; what joins browsers to votes is deleted then. Delete the file to delete the votes.`;
  if (held) (document.getElementById(held) ?? content.querySelector(".steps .main"))?.focus();
}

try {
  room = await ask("api/room", key);
  listQuestions();
  follow(key, { show, lost: say, gone: () => false, jitter: 100 });
} catch (error) {
  say(error.message);
}
