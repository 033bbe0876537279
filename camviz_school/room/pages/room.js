// What all pages of a room share: elements, questions to the server, and waiting for news.

export function element(tag, options = {}, ...children) {
  const { html, class: className, on = {}, ...attributes } = options;
  const node = document.createElement(tag);
  if (className) node.className = className;
  if (html !== undefined) node.innerHTML = html; // of the lessons, escaped by camviz.draw.prose; never a student's
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== null && value !== undefined && value !== false) node.setAttribute(name, value === true ? "" : value);
  }
  for (const [name, handler] of Object.entries(on)) node.addEventListener(name, handler);
  node.append(...children.filter((child) => child !== null && child !== ""));
  return node;
}

export const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

export class Refused extends Error {
  constructor(status, sentence) {
    super(sentence);
    this.status = status;
  }
}

// The server's answer; a Refused with its sentence where it says no, and a TypeError where nobody answers.
export async function ask(path, key, body, method = body ? "POST" : "GET") {
  const headers = { ...(key && { Authorization: `Bearer ${key}` }), ...(body && { "Content-Type": "application/json" }) };
  const answer = await fetch(new URL(`../${path}`, import.meta.url), { method, headers, body: body && JSON.stringify(body), cache: "no-store" });
  const told = await answer.json().catch(() => ({ problem: `The room's server says ${answer.status}.` }));
  if (!answer.ok) throw new Refused(answer.status, told.problem);
  return told;
}

// Calls `show` with every new state, for ever; `lost` with a sentence, and "" when all is well again. It ends when
// `gone` says so of a refusal.
export async function follow(key, { show, lost, gone, jitter = 300 }) {
  let seen = "", failures = 0;
  for (;;) {
    try {
      const told = await ask(`api/state?seen=${encodeURIComponent(seen)}`, key);
      if (failures) lost("");
      failures = 0;
      seen = told.state;
      show(told);
      await pause(200 + jitter * Math.random());
    } catch (error) {
      if (error instanceof Refused && gone(error)) return;
      failures += 1;
      if (failures > 1) lost(error instanceof Refused ? error.message : "No connection to the room. Trying again …");
      await pause(Math.min(8000, 500 * 2 ** failures) * (0.75 + 0.5 * Math.random()));
    }
  }
}

export const share = (votes, all) => (all ? Math.round((100 * votes) / all) : 0);

export const sum = (numbers) => numbers.reduce((total, one) => total + one, 0);

export const haveJoined = (number) => `${number} ${number === 1 ? "has" : "have"} joined`;

// A bar for each vote on one choice, under one another: the first hatched, the second full, each with its number.
export function bars(counts, choice, chosen = {}) {
  return element("div", { class: "bars" }, ...Object.entries(counts).map(([round, votes]) => {
    const filled = element("span", { class: `filled round${round}${votes[choice] ? "" : " none"}` });
    const percent = share(votes[choice], sum(votes));
    filled.style.width = `${percent}%`;
    const own = chosen[round] === choice ? "your " : "";
    return element("div", { class: "bar" },
      element("span", { class: "which" }, `${own}${round === "1" ? "first" : "second"} vote`),
      element("span", { class: "track", "aria-hidden": "true" }, filled),
      element("span", { class: "much" }, `${percent} % (${votes[choice]})`));
  }));
}
