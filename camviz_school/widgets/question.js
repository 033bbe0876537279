// A question to commit to. The kernel sends `cards`; the page sends { question, choice } and shows the reply that comes.
// A card that has been answered and is neither right nor wrong (`correct` is null) is closed: it takes one choice only.
// While a class is voting on it (`voting`) it has no reply to the choice either, and the choice can be changed; before and
// after a vote it can be `held`, and takes none.

function element(tag, className, html) {
  const node = document.createElement(tag);
  if (className) node.className = className;
  if (html) node.innerHTML = html; // escaped by the kernel (camviz.prose)
  return node;
}

// JupyterLab takes the arrow keys for its cells unless the focused element itself asks it not to.
function keepKeys(node) {
  node.dataset.lmSuppressShortcuts = "true";
  return node;
}

function choiceRow(name, card, index) {
  const row = element("label", "camviz-choice");
  const radio = keepKeys(element("input"));
  Object.assign(radio, { type: "radio", name, value: index, checked: card.chosen === index });
  row.append(radio, element("span", "", card.choices[index]));
  return row;
}

function cardForm(name, number, send) {
  const form = element("form", "camviz-card");
  const fieldset = element("fieldset");
  const text = element("legend");
  const rows = element("div");
  const button = keepKeys(element("button", "camviz-commit"));
  const reply = element("div", "camviz-reply");
  button.type = "submit";
  reply.setAttribute("role", "status"); // read out when it changes
  reply.id = `${name}-reply`;
  fieldset.setAttribute("aria-describedby", reply.id); // and when the reader comes back to an answered question
  reply.tabIndex = -1; // takes the focus of a button that has gone
  fieldset.append(text, rows, button);
  form.append(fieldset, reply);
  let card = null, spoken = "";

  const closed = () => card.held || card.tries > 0 && card.correct === null && !card.voting;
  const selected = () => {
    const radio = rows.querySelector("input:checked");
    return radio ? Number(radio.value) : null;
  };
  const refresh = () => {
    button.disabled = selected() === null || selected() === card.chosen || card.correct === true || closed();
    button.textContent = card.tries ? "Commit to this instead" : "Commit to this answer";
    button.hidden = card.correct === true || closed();
    rows.querySelectorAll("input").forEach((radio) => { radio.disabled = closed(); });
  };
  rows.addEventListener("change", refresh);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (!button.disabled) send({ question: number, choice: selected() });
  });

  return {
    form,
    focus: () => rows.querySelector("input").focus(),
    show(next) {
      if (card?.tries && !next.tries) rows.querySelectorAll("input").forEach((radio) => { radio.checked = false; });
      const first = card === null;
      const answered = first || next.chosen !== card.chosen || next.tries !== card.tries; // else a choice is being made
      card = next;
      if (first) {
        text.innerHTML = card.text;
        rows.append(...card.choices.map((_, index) => choiceRow(name, card, index)));
      } else if (card.chosen !== null && (answered || closed())) {
        rows.querySelectorAll("input")[card.chosen].checked = true;
      } else if (card.chosen === null && card.held) {
        rows.querySelectorAll("input").forEach((radio) => { radio.checked = false; }); // was not counted
      }
      const [verdict, colour] = closed() || card.voting ? ["", " camviz-kept"]
        : card.correct ? ["<strong>✓ Correct.</strong>", " camviz-right"] : ["<strong>✗ Not this one.</strong>", " camviz-wrong"];
      const earlier = card.earlier ? `<span class="camviz-earlier">You answered this earlier.</span> ` : "";
      const said = card.reply ? `${earlier}${verdict}${card.reply}` : "";
      if (said !== spoken) reply.innerHTML = spoken = said; // what stays the same is not read out again
      reply.className = `camviz-reply${card.reply ? colour : ""}`;
      const hadFocus = document.activeElement === button;
      refresh();
      if (hadFocus && closed()) reply.focus();
      else if (hadFocus && (button.hidden || button.disabled)) rows.querySelector("input:checked").focus();
    },
  };
}

// What comes below the questions: what was thought before the lesson, the button that writes the answers to a file (both
// with the last answer), and the one that clears them.
function lastWords(send, cleared) {
  const node = element("div", "camviz-last");
  const back = element("div");
  const write = keepKeys(element("button", "camviz-commit"));
  const again = keepKeys(element("button", "camviz-commit"));
  const said = element("div", "camviz-said");
  write.type = again.type = "button";
  write.textContent = "Write my answers to a file, without my name";
  write.addEventListener("click", () => send({ export: true }));
  again.textContent = "Start again";
  again.addEventListener("click", () => { clearing = true; send({ again: true }); });
  said.setAttribute("role", "status");
  node.append(back, write, again, said);
  let shown = null, clearing = false, told = "";
  return {
    node,
    show(lookingBack, canExport, canStartAgain, exported) {
      if (lookingBack !== shown) back.innerHTML = shown = lookingBack;
      back.querySelectorAll("summary").forEach(keepKeys);
      write.hidden = !canExport;
      again.hidden = !canStartAgain;
      if (canStartAgain) told = "";
      else if (clearing) {
        told = "Your answers here are cleared.";
        clearing = false;
        cleared(); // the button that had the focus is gone
      }
      const words = told || exported;
      if (said.textContent !== words) said.textContent = words;
    },
  };
}

function render({ model, el }) {
  const view = Math.random().toString(36).slice(2); // every widget loads this file anew: a count would repeat
  const root = element("div", "camviz-question");
  root.setAttribute("role", "group"); // a landmark would need a name of its own
  const title = element("div", "camviz-title");
  title.textContent = model.get("title");
  root.setAttribute("aria-label", model.get("title"));
  const forms = model.get("cards").map((_, number) =>
    cardForm(`camviz-${view}-${number}`, number, (message) => model.send(message)),
  );
  const lead = element("div", "camviz-lead");
  lead.textContent = model.get("lead");
  const last = lastWords((message) => model.send(message), () => forms[0].focus());
  const room = element("div", "camviz-room"); // of a class that votes: how that went
  room.setAttribute("role", "status");
  const summary = element("div", "camviz-summary");
  summary.setAttribute("role", "status");
  const problem = element("div", "camviz-problem");
  problem.setAttribute("role", "alert");
  root.append(title, lead, ...forms.map((one) => one.form), room, summary, last.node, problem);
  const hidesStill = element("style");   // while this lives, the saved page is not needed
  hidesStill.textContent = model.get("still_hidden");
  el.append(hidesStill, root);

  const update = () => {
    model.get("cards").forEach((card, number) => forms[number].show(card));
    if (summary.textContent !== model.get("summary")) summary.textContent = model.get("summary");
    last.show(model.get("looking_back"), model.get("can_export"), model.get("can_start_again"), model.get("exported"));
    if (room.textContent !== model.get("room")) room.textContent = model.get("room");
    problem.textContent = model.get("problem");
  };
  const names = ["cards", "summary", "looking_back", "can_start_again", "can_export", "exported", "problem", "room"];
  names.forEach((name) => model.on(`change:${name}`, update));
  update();
  return () => names.forEach((name) => model.off(`change:${name}`, update));
}

export default { render };
