// A question to commit to. The kernel sends `cards`; the page sends { question, choice } and shows the reply that comes.

let views = 0;

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
  fieldset.append(text, rows, button);
  form.append(fieldset, reply);
  let card = null;

  const selected = () => {
    const radio = rows.querySelector("input:checked");
    return radio ? Number(radio.value) : null;
  };
  const refresh = () => {
    button.disabled = selected() === null || selected() === card.chosen || card.correct === true;
    button.textContent = card.tries ? "Commit to this instead" : "Commit to this answer";
    button.hidden = card.correct === true;
  };
  rows.addEventListener("change", refresh);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (!button.disabled) send({ question: number, choice: selected() });
  });

  return {
    form,
    show(next) {
      const first = card === null;
      card = next;
      if (first) {
        text.innerHTML = card.text;
        rows.append(...card.choices.map((_, index) => choiceRow(name, card, index)));
      } else if (card.chosen !== null) {
        rows.querySelectorAll("input")[card.chosen].checked = true;
      }
      const verdict = card.correct ? "✓ Correct." : "✗ Not this one.";
      reply.innerHTML = card.reply ? `<strong>${verdict}</strong>${card.reply}` : "";
      reply.className = `camviz-reply${card.reply ? (card.correct ? " camviz-right" : " camviz-wrong") : ""}`;
      const hadFocus = document.activeElement === button;
      refresh();
      if (hadFocus && (button.hidden || button.disabled)) rows.querySelector("input:checked").focus();
    },
  };
}

function render({ model, el }) {
  const view = ++views;
  const root = element("section", "camviz-question");
  const title = element("div", "camviz-title");
  title.textContent = model.get("title");
  root.setAttribute("aria-label", model.get("title"));
  const forms = model.get("cards").map((_, number) =>
    cardForm(`camviz-${view}-${number}`, number, (message) => model.send(message)),
  );
  const summary = element("div", "camviz-summary");
  summary.setAttribute("role", "status");
  const problem = element("div", "camviz-problem");
  problem.setAttribute("role", "alert");
  root.append(title, ...forms.map((one) => one.form), summary, problem);
  const hidesStill = element("style");   // while this lives, the saved page is not needed
  hidesStill.textContent = model.get("still_hidden");
  el.append(hidesStill, root);

  const update = () => {
    model.get("cards").forEach((card, number) => forms[number].show(card));
    summary.textContent = model.get("summary");
    problem.textContent = model.get("problem");
  };
  const names = ["cards", "summary", "problem"];
  names.forEach((name) => model.on(`change:${name}`, update));
  update();
  return () => names.forEach((name) => model.off(`change:${name}`, update));
}

export default { render };
