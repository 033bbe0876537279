// The page of a guided calibration: it shows the camera and what the kernel answers, and computes nothing itself.
// One frame is under way at a time. The next one is drawn from the camera when the answer has come, so none is old.

const LATE_MS = 10000;     // silence of the kernel after which the reader is told
const QUALITY = 0.92;      // of the JPEG frames
const REFUSED = {
  insecure: "This page has no camera, because browsers give one only to https and to localhost. Open the notebook by an https address, or run Jupyter on your own machine.",
  embedded: "This notebook is shown in a frame that is not allowed to use the camera. Open it in JupyterLab, in a tab of its own.",
  NotAllowedError: "The browser was not allowed to use the camera. Click the camera symbol beside the address, allow it, and press Start again.",
  NotFoundError: "No camera was found. Plug one in, see that it is switched on, and press Start again.",
  NotReadableError: "The camera is in use by another tab or program. Close it there, and press Start again.",
  ended: "The camera has stopped: it was unplugged, or taken back. Plug it in, and press Start again.",
};
const LATE = "The kernel has not answered for 10 s. It is at work on another cell, or it was restarted: then run this cell again.";
const OTHER = (error) => `The camera could not be opened (${error.name}: ${error.message}). Close other programs that use it, and press Start again.`;

function render({ model, el }) {
  const root = document.createElement("div");
  root.className = "camviz-capture";
  root.dataset.state = "idle";
  root.innerHTML = `<div class="camviz-stage" data-mirrored="true"><video muted playsinline hidden></video><canvas class="frame" hidden></canvas>
    <canvas class="overlay" role="img" aria-label="the camera's picture with the orange board to cover"></canvas></div>
    <div class="camviz-beside"><div class="camviz-row"><button type="button" class="start">Start</button><button type="button" class="stop" disabled>Stop</button>
    <label><input type="checkbox" class="mirror" checked> mirror</label></div>
    <p class="sentence" role="status"></p><p class="error" role="alert" hidden></p>
    <p class="numbers"></p><svg viewBox="0 0 240 94" role="img" aria-label="σ of fx by the number of views"></svg><p class="promise"></p></div>`;
  const find = (query) => root.querySelector(query);
  const [video, frame, overlay] = [find("video"), find(".frame"), find(".overlay")];
  const hidesStill = Object.assign(document.createElement("style"), { textContent: model.get("still_hidden") });
  el.replaceChildren(hidesStill, root);
  find(".promise").textContent = model.get("promise");
  const film = model.get("film");
  find(".sentence").textContent = film ? "Press Start to play the film." : "Press Start, and allow the camera.";
  const stage = find(".camviz-stage");
  const mirror = () => { stage.dataset.mirrored = String(find(".mirror").checked); };
  find(".mirror").checked = !film;
  mirror();
  find(".mirror").addEventListener("change", mirror);

  let stream = null, running = false, number = 0, underWay = null, delay = null, late = null;

  const fail = (words) => { stop(); find(".error").textContent = words; find(".error").hidden = false; root.dataset.state = "refused"; };
  const stop = () => {
    [running, underWay] = [false, null];
    clearTimeout(late);
    stream?.getTracks().forEach((track) => { track.onended = null; track.stop(); });
    if (stream && number) [video.hidden, frame.hidden] = [true, false];      // a video without its camera is black
    stream = null;
    if (root.dataset.state === "live") root.dataset.state = "idle";
    [find(".start").disabled, find(".stop").disabled] = [false, true];
  };
  const start = async () => {
    find(".error").hidden = find(".start").disabled = true;
    if (!film && !(await openCamera())) return;
    running = true;
    [root.dataset.state, find(".stop").disabled] = ["live", false];
    next();
  };
  const openCamera = async () => {
    if (!navigator.mediaDevices?.getUserMedia) { fail(REFUSED.insecure); return false; }
    const policy = document.permissionsPolicy ?? document.featurePolicy;
    if (policy && !policy.allowsFeature("camera")) { fail(REFUSED.embedded); return false; }
    const [width, height] = model.get("wanted");
    try {       // resizeMode: the sensor's own pixels, none that the browser has cropped or scaled
      stream = await navigator.mediaDevices.getUserMedia({ audio: false, video: { width: { ideal: width }, height: { ideal: height }, resizeMode: { ideal: "none" } } });
      stream.getTracks().forEach((track) => { track.onended = () => fail(REFUSED.ended); });
      video.srcObject = stream;
      await video.play();
    } catch (error) {
      fail(REFUSED[error.name] ?? OTHER(error));
      return false;
    }
    return !(video.hidden = false);
  };

  const next = async () => {
    if (!running || underWay) return;
    const message = { number: ++number, time: performance.now() / 1000, delay };
    underWay = { number, began: performance.now() };
    const buffers = film ? [] : [await grabbed()];
    if (underWay?.number !== message.number) return;         // stopped meanwhile
    clearTimeout(late);
    late = setTimeout(() => { find(".error").textContent = LATE; find(".error").hidden = false; }, LATE_MS);
    root.dataset.sent = message.number;
    model.send(message, undefined, buffers);
  };
  const grabbed = async () => {
    Object.assign(frame, { width: video.videoWidth, height: video.videoHeight });
    frame.getContext("2d", { willReadFrequently: true }).drawImage(video, 0, 0);
    const blob = await new Promise((done) => frame.toBlob(done, "image/jpeg", QUALITY));
    return new DataView(await blob.arrayBuffer());
  };
  const answered = async (answer, buffers) => {
    if (answer.number !== underWay?.number) return;           // of another page that shows this widget, or from before Stop
    clearTimeout(late);
    if (answer.error) { fail(answer.error); return; }
    find(".error").hidden = true;
    if (film && buffers?.length) await showFrame(buffers[0]);
    draw(overlay, answer);
    tell(root, answer);
    delay = performance.now() - underWay.began;
    root.dataset.answered = answer.number;
    underWay = null;
    if (answer.done) { stop(); root.dataset.state = "done"; return; }
    if (film) setTimeout(next, 0); else if (video.requestVideoFrameCallback && !document.hidden) video.requestVideoFrameCallback(next); else setTimeout(next, 30);
  };
  const showFrame = async (bytes) => {
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/jpeg" }));
    frame.hidden = false;
    Object.assign(frame, { width: bitmap.width, height: bitmap.height });
    frame.getContext("2d").drawImage(bitmap, 0, 0);
  };

  find(".start").addEventListener("click", start);
  find(".stop").addEventListener("click", () => { stop(); find(".sentence").textContent = "Stopped. The views taken so far are kept."; });
  model.on("msg:custom", answered);
  return () => { model.off("msg:custom", answered); stop(); };
}

function draw(canvas, answer) {
  const [width, height] = answer.size;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const pen = canvas.getContext("2d");
  pen.clearRect(0, 0, width, height);
  pen.fillStyle = "rgba(0, 114, 178, 0.10)";
  answer.covered.forEach((rim) => fill(pen, rim));
  ghost(pen, answer);
  pen.fillStyle = answer.taken ? "#00c853" : "#00b0ff";
  for (const [x, y] of answer.corners) if (x !== null) { pen.beginPath(); pen.arc(x, y, width / 200, 0, 7); pen.fill(); }
  if (answer.taken) { pen.strokeStyle = "#00c853"; pen.lineWidth = width / 60; pen.strokeRect(0, 0, width, height); }
}

function ghost(pen, { ghost: rows, squares, size }) {
  if (!rows.length) return;
  const last = rows.length - 1, end = rows[0].length - 1;
  pen.fillStyle = "rgba(230, 120, 0, 0.38)";
  for (let i = 0; squares && i < last; i++) for (let j = 0; j < end; j++) if ((i + j) % 2 === 0) fill(pen, [rows[i][j], rows[i][j + 1], rows[i + 1][j + 1], rows[i + 1][j]]);
  pen.strokeStyle = "#e67800";
  pen.lineWidth = size[0] / 200;
  outline(pen, [...rows[0], ...rows.map((row) => row[end]), ...rows[last].toReversed(), ...rows.map((row) => row[0]).toReversed()]);
  pen.stroke();
}

function outline(pen, points) {
  pen.beginPath();
  points.filter(([x]) => x !== null).forEach(([x, y]) => pen.lineTo(x, y));
  pen.closePath();
}

function fill(pen, points) { outline(pen, points); pen.fill(); }

function tell(root, { sentence, known, views, coverage, done }) {
  const say = root.querySelector(".sentence");
  if (say.textContent !== sentence) say.textContent = sentence;
  const [, fx, sigma, largest] = known.at(-1) ?? [];
  const focal = fx === undefined ? "fx not known yet" : `fx = ${fx.toFixed(1)} px ± ${sigma === null ? "not known" : sigma.toPrecision(2)}`;
  const worst = largest ? ` · largest expected error ${largest.toPrecision(2)} px` : "";
  root.querySelector(".numbers").textContent = `${views} ${views === 1 ? "view" : "views"} · ${Math.round(100 * coverage)} % covered · ${focal}${worst}`;
  if (known.length && root.dataset.plotted !== String(known.length)) plot(root.querySelector("svg"), known);
  Object.assign(root.dataset, { plotted: known.length, views, done });
}

function plot(svg, all) {
  const known = all.filter(([, , sigma]) => sigma !== null);
  if (!known.length) return;
  const logs = known.map(([, , sigma]) => Math.log10(Math.max(sigma, 1e-3)));
  const top = Math.ceil(Math.max(...logs)), bottom = Math.min(Math.floor(Math.min(...logs)), top - 1);
  const x = (i) => 40 + (i * 190) / Math.max(known.length - 1, 1), y = (log) => 12 + ((top - log) * 62) / (top - bottom);
  const dots = logs.map((log, i) => `<circle cx="${x(i)}" cy="${y(log)}" r="3"/>`).join("");
  const line = `<polyline points="${logs.map((log, i) => `${x(i)},${y(log)}`).join(" ")}"/>`;
  const marks = [top, bottom].map((log) => `<text x="34" y="${y(log) + 4}" text-anchor="end">${10 ** log}</text>`).join("");
  svg.innerHTML = `${line}${dots}${marks}<text x="40" y="88">σ of fx in px, by ${known.length > 1 ? `${known[0][0]} to ` : ""}${known.at(-1)[0]} views</text>`;
}

export default { render };
