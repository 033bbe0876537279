// What the whole room sees: the question, how many have voted, and once revealed the split with the reply that is right.

import { ask, bars, element, follow, haveJoined } from "./room.js";

const key = location.hash.slice(1);
const content = document.getElementById("content"), news = document.getElementById("news"), door = document.getElementById("door");
let room = null, latest = null;

function entrance(large) {
  const code = element("img", { src: room.qr, alt: "QR code of the address with the word", class: "qr" });
  return element("div", { class: large ? "entrance large" : "entrance" }, ...(room.qr ? [code] : []),
    element("p", {}, "Open ", element("strong", { class: "address" }, room.address), " and join with the word ",
      element("strong", { class: "word" }, room.word)));
}

function counted(told, question) {
  const round = question.rounds.at(-1);
  if (!round) return "";
  const which = round.round === 1 ? "First vote" : "Second vote";
  const voted = `${round.voted} of ${told.joined} have voted`;
  return question.open ? `${which}: ${voted}` : `${which} is closed: ${voted}`;
}

function asked(told) {
  const question = told.question;
  const rows = question.choices.map((choice, index) => {
    const right = question.revealed && index === question.answer;
    return element("li", { class: right ? "right" : "" },
      element("div", { class: "text" }, element("span", { class: "letter" }, `${right ? "✓ " : ""}(${question.letters[index]})`), element("span", { html: choice })),
      question.revealed ? bars(question.counts, index) : "");
  });
  const reply = question.revealed && question.reply
    ? element("div", { class: "reply" }, element("strong", {}, `To (${question.letters[question.pointed]}): `), element("div", { html: question.reply })) : "";
  return [element("div", { class: "asked", html: question.text }), element("ul", { class: "choices" }, ...rows), reply,
    question.discuss ? element("p", { class: "discuss" }, question.discuss) : ""];
}

function show(told) {
  latest = told;
  const question = told.question;
  const idle = told.ended ? "The room has ended. Thank you." : told.at_home ? "The questions are open at home." : "";
  content.replaceChildren(...(question && !told.ended ? asked(told) : [idle ? element("p", { class: "asked" }, idle) : "", told.ended ? "" : entrance(true)]));
  door.replaceChildren(question && !question.revealed && !told.ended ? entrance(false) : "");
  document.body.classList.toggle("asking", Boolean(question) && !told.ended);
  const words = question && !told.ended ? counted(told, question) : haveJoined(told.joined);
  if (news.textContent !== words) news.textContent = words;
  fit();
}

// The largest print that fits, down to half of what is wanted; then the page scrolls.
function fit() {
  const root = document.documentElement;
  for (let scale = 1; scale >= 0.5; scale -= 0.05) {
    root.style.setProperty("--scale", scale);
    if (root.scrollHeight <= innerHeight && root.scrollWidth <= innerWidth) return;
  }
}

addEventListener("resize", () => { if (latest) fit(); });
try {
  room = await ask("api/room", key);
  follow(key, { show, lost: (sentence) => { if (sentence) news.textContent = sentence; else if (latest) show(latest); }, gone: () => false, jitter: 100 });
} catch (error) {
  news.textContent = error.message;
}
