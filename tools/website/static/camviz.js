// The site's own script: questions made live, answers kept in this browser, the glossary's cards, progress, search.

// A model for a widget that has no kernel: what it holds, who listens, and what becomes of a message.
class Model {
  constructor(state, receive) {
    this.state = state;
    this.listeners = {};
    this.send = receive;
  }
  get(name) { return this.state[name]; }
  on(event, listener) { (this.listeners[event] ??= []).push(listener); }
  off(event, listener) { this.listeners[event] = (this.listeners[event] ?? []).filter((one) => one !== listener); }
  put(changes) {
    Object.assign(this.state, changes);
    for (const name of Object.keys(changes)) (this.listeners[`change:${name}`] ?? []).forEach((listener) => listener());
  }
}

// Answers: what was chosen at each question, in order, by lesson, when and topic. A browser that keeps nothing says so.
const answers = {
  prefix: "camviz.answers.",
  problem: "",
  read(lesson) {
    try {
      return JSON.parse(localStorage.getItem(this.prefix + lesson)) ?? {};
    } catch {
      this.problem = "This browser keeps nothing for this page: your answers are lost when you leave it.";
      return {};
    }
  },
  chosen(asked, question, when = asked.when) {
    const made = this.read(asked.lesson)[this.key(question, when)] ?? [];
    return made.filter((index) => question.choices[index]);
  },
  key(question, when) { return [when, question.form, question.topic].join(" "); },
  keep(asked, question, choices) {
    const all = this.read(asked.lesson);
    if (choices.length) all[this.key(question, asked.when)] = choices;
    else delete all[this.key(question, asked.when)];
    try {
      localStorage.setItem(this.prefix + asked.lesson, JSON.stringify(all));
    } catch {
      this.problem = "This browser keeps nothing for this page: your answers are lost when you leave it.";
    }
  },
  // All that was ever chosen in a lesson, so that a first choice stays the first, under a random code.
  history(lesson) {
    const name = `${this.prefix}${lesson}.history`;
    const fresh = () => Array.from(crypto.getRandomValues(new Uint8Array(4)), (one) => one.toString(16).padStart(2, "0")).join("");
    try {
      return JSON.parse(localStorage.getItem(name)) ?? { code: fresh(), made: {} };
    } catch {
      return { code: fresh(), made: {} };
    }
  },
  remember(asked, question, choice) {
    const history = this.history(asked.lesson), key = this.key(question, asked.when);
    history.made[key] = [...(history.made[key] ?? []), choice];
    try {
      localStorage.setItem(`${this.prefix}${asked.lesson}.history`, JSON.stringify(history));
    } catch {
      this.problem = "This browser keeps nothing for this page: your answers are lost when you leave it.";
    }
  },
  clear() {
    Object.keys(localStorage).filter((key) => key.startsWith(this.prefix)).forEach((key) => localStorage.removeItem(key));
  },
};

// What a class's room says of a question while the class votes on it. Its script takes the place of these where a room
// serves the page (camviz_school/room/pages/lesson.js); elsewhere nothing does.
window.camvizClassroom = { card: () => null, send: () => {}, said: () => "", settled: () => [] };

const KEPT = "<p>Kept. The answers come with the quiz at the end.</p>";

// A question as question.js shows it: what camviz_school.widgets.question tells the page in a notebook.
function card(question, made, earlier, silent) {
  const shown = { text: question.text, choices: question.choices.map(({ text }) => text), tries: made.length, earlier };
  if (!made.length) return { ...shown, chosen: null, correct: null, reply: "" };
  const chosen = made.at(-1), { correct, reply } = question.choices[chosen];
  return silent ? { ...shown, chosen, correct: null, reply: KEPT } : { ...shown, chosen, correct, reply };
}

// Questions live in `place`; `others` are all questions of this page, for looking back on those asked before the lesson.
function makeLive(place, asked, others) {
  const silent = asked.when === "before", classroom = window.camvizClassroom;
  let tries = asked.questions.map((one) => answers.chosen(asked, one));
  let earlier = tries.map((made) => made.length > 0), exported = "";
  const state = () => ({
    cards: asked.questions.map((one, i) => ({ ...card(one, tries[i], earlier[i], silent), ...classroom.card(one) })),
    room: classroom.said(asked.questions),
    can_start_again: tries.some((made) => made.length),
    summary: silent ? summaryBefore() : score(),
    looking_back: !silent && asked.when === "after" && tries.every((made) => made.length) ? lookingBack(others) : "",
    can_export: asked.when === "after" && tries.every((made) => made.length), exported, problem: answers.problem,
  });
  const summaryBefore = () => (tries.every((made) => made.length) ? "Kept in this browser, and nowhere else." : "");
  const score = () => {
    if (asked.questions.length < 2 || !tries.every((made) => made.length)) return "";
    const right = asked.questions.filter((one, i) => one.choices[tries[i][0]].correct).length;
    return `${right} of ${asked.questions.length} right at the first try.`;
  };
  const change = (number, made) => {
    tries[number] = made;
    earlier[number] = false;
    answers.keep(asked, asked.questions[number], made);
  };
  const model = new Model({ title: asked.title, lead: asked.lead, still_hidden: "", ...state() }, (message) => {
    if (classroom.card(asked.questions[message.question] ?? {})) return classroom.send(asked.questions[message.question], message.choice);
    if (message.export) exported = exportAnswers(asked.lesson, others);
    else if (message.again) asked.questions.forEach((_, number) => change(number, []));
    else {
      answers.remember(asked, asked.questions[message.question], message.choice);
      change(message.question, [...tries[message.question], message.choice]);
    }
    model.put(state());
    document.dispatchEvent(new Event("camviz-answers"));
    return undefined;
  });
  document.addEventListener("camviz-room", () => {
    asked.questions.forEach((one, number) => {
      const made = classroom.settled(one, tries[number]);
      made.forEach((choice) => answers.remember(asked, one, choice));
      if (made.length) change(number, made);
    });
    model.put(state());
  });
  camvizQuestion({ model, el: place });
}

// Saves both forms of a lesson's quiz as camviz_school.course.answers writes them: answers_05_3f9a2c1b.csv, without a name.
function exportAnswers(lesson, others) {
  const { code, made } = answers.history(lesson);
  const rows = others.flatMap((asked) => asked.questions.filter(({ form }) => form).flatMap((one) => {
    const chosen = made[answers.key(one, asked.when)] ?? answers.chosen(asked, one);
    return chosen.filter((choice) => one.choices[choice]).map((choice, number) => {
      const { correct, misconception } = one.choices[choice];
      const letter = "abcdefgh"[choice];
      return [code, lesson, asked.when, one.form, one.topic, number + 1, letter, Number(correct), misconception];
    });
  }));
  const head = "participant,lesson,when,form,concept,attempt,choice,correct,misconception".split(",");
  const quoted = (value) => (/[",\n]/.test(value) ? `"${String(value).replaceAll('"', '""')}"` : value);
  const text = [head, ...rows].map((row) => `${row.map(quoted).join(",")}\n`).join("");
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  link.download = `answers_${lesson}_${code}.csv`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  return `Saved as ${link.download}: ${rows.length} choices, a random code, no name.`;
}

// What was thought before the lesson, with the replies, as folded HTML; "" where nothing was chosen then.
function lookingBack(others) {
  const before = others.filter(({ when }) => when === "before");
  const made = before.flatMap((asked) => asked.questions.map((one) => [one, answers.chosen(asked, one)[0]]));
  const chosen = made.filter(([, choice]) => choice !== undefined);
  if (!chosen.length) return "";
  const right = chosen.filter(([one, choice]) => one.choices[choice].correct).length;
  const then = ([one, choice]) => {
    const answer = one.choices.findIndex(({ correct }) => correct);
    const says = (words, index) => `<p><em>${words}</em> ${one.choices[index].text}</p><blockquote>${one.choices[index].reply}</blockquote>`;
    const shown = choice === answer ? says("You chose the answer:", choice) : says("You chose:", choice) + says("The answer:", answer);
    return `<div>${one.text}${shown}</div>`;
  };
  const summary = `Before the lesson: ${right} of ${chosen.length} right. What you chose then, and the answers`;
  return `<details><summary>${summary}</summary>${chosen.map(then).join("")}</details>`;
}

function questions() {
  const places = [...document.querySelectorAll(".camviz-asked")];
  const all = places.map((place) => JSON.parse(place.querySelector("script").textContent));
  places.forEach((place, number) => {
    const live = document.createElement("div");
    makeLive(live, all[number], all);
    place.querySelector(".camviz-folded").replaceWith(live);
  });
}

// How many of a lesson's questions are answered, on the map of the lessons.
function progress() {
  for (const place of document.querySelectorAll(".lesson-progress")) {
    const count = Object.keys(answers.read(place.dataset.lesson)).filter((key) => !key.startsWith("before")).length;
    place.textContent = count ? `${count} of ${place.dataset.questions} questions answered` : "";
  }
  const clear = document.querySelector(".camviz-clear");
  if (!clear) return;
  clear.hidden = false;
  clear.addEventListener("click", () => {
    answers.clear();
    document.querySelector(".camviz-cleared").textContent = " Your answers are cleared.";
    document.querySelectorAll(".lesson-progress").forEach((place) => { place.textContent = ""; });
  });
}

// A term's sentence beside the link that leads to it, for pointer and keyboard; Escape closes it (WCAG 1.4.13).
function terms() {
  const links = document.querySelectorAll("a.term");
  if (!links.length) return;
  let open = null, leaving = null, loading = null;
  const close = () => { open?.card.remove(); open?.link.removeAttribute("aria-describedby"); open = null; };
  const load = () => (loading ??= loadScript("_static/terms.js"));
  const show = async (link) => {
    clearTimeout(leaving);
    if (open?.link === link) return;
    close();
    await load();
    const words = window.camvizTerms?.[link.hash.slice(1)];
    if (!words || (!link.matches(":hover") && document.activeElement !== link)) return;
    const card = document.createElement("div");
    Object.assign(card, { className: "term-card", id: "term-card", role: "tooltip", innerHTML: words });
    document.body.append(card);
    const box = link.getBoundingClientRect(), page = document.documentElement;
    card.style.left = `${Math.max(12, Math.min(box.left, page.clientWidth - card.offsetWidth - 12)) + scrollX}px`;
    card.style.top = `${box.bottom + scrollY + 4}px`;
    card.addEventListener("pointerenter", () => clearTimeout(leaving));
    card.addEventListener("pointerleave", later);
    link.setAttribute("aria-describedby", "term-card");
    open = { link, card };
  };
  const later = () => { leaving = setTimeout(close, 250); };
  for (const link of links) {
    link.addEventListener("pointerenter", () => show(link));
    link.addEventListener("focus", () => show(link));
    link.addEventListener("pointerleave", later);
    link.addEventListener("blur", close);
  }
  document.addEventListener("keydown", (event) => { if (event.key === "Escape") close(); });
}

function loadScript(way) {
  return new Promise((done) => {
    const script = document.createElement("script");
    script.src = document.documentElement.dataset.content_root + way;
    script.onload = script.onerror = done;
    document.head.append(script);
  });
}

// Panes come to life at the first sign of a hand, or when the page has been there for a while: until then its words and
// first pictures have the line for themselves.
const UNTOUCHED_MS = 4000;
const SIGNS = ["pointermove", "pointerdown", "touchstart", "scroll", "wheel", "keydown"];
function panes() {
  if (!document.querySelector(".camviz-recorded")) return;
  const begin = () => {
    SIGNS.forEach((sign) => removeEventListener(sign, begin, true));
    begun ??= loadScript("_static/replay.js");
  };
  let begun = null;
  SIGNS.forEach((sign) => addEventListener(sign, begin, { capture: true, passive: true }));
  addEventListener("load", () => setTimeout(begin, UNTOUCHED_MS));
}

// One switch for the code of cells that only set up, ask or show; without scripts each of them has its own fold.
function code() {
  const button = document.querySelector(".camviz-code button"), page = document.documentElement.dataset;
  if (!button) return;
  button.addEventListener("click", () => {
    const shown = page.code === "hidden", top = button.getBoundingClientRect().top;
    page.code = shown ? "shown" : "hidden";
    document.querySelectorAll("details.hide.above-input").forEach((one) => { one.open = shown; });
    button.textContent = shown ? "Hide the code" : "Show all code";
    scrollBy(0, button.getBoundingClientRect().top - top);  // what opens above it does not push it away
  });
}

// A pane that an exercise's function draws: buttons show it with the solution, or with a usual mistake.
function mistakes() {
  for (const place of document.querySelectorAll(".camviz-drawn-with")) {
    const drawn = place.querySelectorAll(":scope > .camviz-with"), buttons = place.querySelectorAll(":scope > p > button");
    buttons.forEach((button, number) => button.addEventListener("click", () => {
      drawn.forEach((one, i) => { one.hidden = i !== number; });
      buttons.forEach((one, i) => { one.ariaPressed = String(i === number); });
    }));
  }
}

// A link into a deeper section, or to its heading, opens it; paper has them all. What has opened is told as a resize: the
// theme measures then which listings scroll, and lets keys reach these.
function deeper() {
  const folded = [...document.querySelectorAll("details.camviz-deeper")];
  folded.forEach((one) => one.addEventListener("toggle", () => dispatchEvent(new Event("resize"))));
  const arrive = () => {
    const target = document.getElementById(location.hash.slice(1));
    const closed = folded.filter((one) => !one.open && (one.contains(target) || one.parentElement === target));
    closed.forEach((one) => { one.open = true; });
    if (closed.length) target.scrollIntoView();
  };
  addEventListener("hashchange", arrive);
  addEventListener("beforeprint", () => folded.forEach((one) => { one.open = true; }));
  arrive();
}

questions();
panes();
code();
deeper();
mistakes();
progress();
terms();
