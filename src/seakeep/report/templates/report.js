"use strict";
(() => {
  // --- tables that can be copied ---
  for (const button of document.querySelectorAll("button.copy")) {
    button.addEventListener("click", () => {
      const rows = Array.from(button.closest(".table").querySelector("table").rows);
      const text = rows.map(row => Array.from(row.cells, cell => cell.textContent.trim()).join("\t")).join("\n");
      const tell = words => {
        button.textContent = words;
        setTimeout(() => { button.textContent = "Copy table"; }, 2000);
      };
      button.dataset.copied = text;
      const copied = navigator.clipboard ? navigator.clipboard.writeText(text) : Promise.reject();
      copied.then(() => tell("Copied"), () => tell("Select and copy by hand"));
    });
  }

  // --- time histories ---
  const holder = document.getElementById("history-data");
  if (!holder) { return; }
  const cells = JSON.parse(holder.textContent);
  const canvas = document.getElementById("history"), pen = canvas.getContext("2d");
  const pick = { cell: document.getElementById("pick-cell"), channel: document.getElementById("pick-channel") };
  const boxes = Array.from(document.querySelectorAll("#history-show input"));
  const readout = document.getElementById("history-readout");
  const margin = { left: 70, right: 14, top: 34, bottom: 40 };
  let range = null, cursor = null, drag = null, plot = null;   // range in s; null: the whole window

  const numbers = packed => {                // 16-bit integers between two bounds, base64
    if (!packed.values) {
      const bytes = Uint8Array.from(atob(packed.data), c => c.charCodeAt(0)), view = new DataView(bytes.buffer);
      const step = (packed.high - packed.low) / 65534;
      packed.values = Float64Array.from({ length: bytes.length / 2 }, (_, i) => {
        const code = view.getUint16(2 * i, true);
        return code === 65535 ? NaN : packed.low + step * code;
      });
    }
    return packed.values;
  };
  const cell = () => cells[pick.cell.selectedIndex];
  const channel = () => cell().channels[pick.channel.selectedIndex];
  const whole = () => [cell().step, cell().step * cell().steps];
  const fill = (select, labels) => {
    const before = Math.max(select.selectedIndex, 0);
    select.replaceChildren(...labels.map(label => new Option(label)));
    select.selectedIndex = Math.min(before, labels.length - 1);
  };
  const series = () => {                     // what is shown, in the order it is drawn
    const shown = new Set(boxes.filter(box => box.checked).map(box => box.value)), out = [], c = channel();
    for (const m of c.models) {
      const name = m.label.replace(/ mean$/, ""), colour = m.colour;
      if (m.members && shown.has("members")) { out.push({ kind: "members", colour, width: .7, values: [numbers(m.members)], label: name + " members" }); }
      if (m.lower && shown.has("band")) { out.push({ kind: "band", colour, values: [numbers(m.lower), numbers(m.upper)], label: name + " band" }); }
    }
    if (shown.has("measured")) { out.push({ kind: "line", colour: "#000000", width: 1.8, values: [numbers(c.measured)], label: "measured" }); }
    if (shown.has("models")) {
      for (const m of c.models) { out.push({ kind: "line", colour: m.colour, width: 1.4, dash: m.dash, values: [numbers(m.mean)], label: m.label }); }
    }
    return out;
  };
  const ticks = (low, high, count) => {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map(f => f * power).find(s => s >= raw), first = Math.ceil(low / step);
    const values = Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, i) => (first + i) * step);
    return { values, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  };
  const line = (...points) => {              // through points, broken where one is missing
    pen.beginPath();
    points.forEach(([x, y], i) => { if (y === y) { (i && points[i - 1][1] === points[i - 1][1] ? pen.lineTo : pen.moveTo).call(pen, x, y); } });
    pen.stroke();
  };
  const style = (s, alpha) => {
    pen.strokeStyle = pen.fillStyle = s.colour;
    pen.lineWidth = s.width || 1;
    pen.setLineDash((s.dash || []).map(d => d * pen.lineWidth));
    pen.globalAlpha = alpha;
  };

  function draw() {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.font = "12px system-ui, sans-serif";
    const c = cell(), span = range || whole(), list = series();
    const first = Math.max(0, Math.floor(span[0] / c.step) - 1), last = Math.min(c.steps - 1, Math.ceil(span[1] / c.step) - 1);
    let low = Infinity, high = -Infinity;
    for (const values of list.flatMap(s => s.values)) {
      values.forEach((v, i) => { if (i % c.steps >= first && i % c.steps <= last && v === v) { low = Math.min(low, v); high = Math.max(high, v); } });
    }
    if (!(low < high)) { low = (isFinite(low) ? low : 0) - 1; high = low + 2; }
    [low, high] = [low - 0.06 * (high - low), high + 0.06 * (high - low)];
    const inner = { w: width - margin.left - margin.right, h: height - margin.top - margin.bottom };
    const xt = t => margin.left + inner.w * (t - span[0]) / (span[1] - span[0]);
    const y = v => margin.top + inner.h * (high - v) / (high - low);
    const points = (values, offset) => Array.from({ length: last - first + 1 }, (_, k) => [xt(c.step * (first + k + 1)), y(values[offset + first + k])]);
    plot = { span, inner };
    frame(span, [low, high], xt, y, width, height);
    pen.save();
    pen.beginPath();
    pen.rect(margin.left, margin.top, inner.w, inner.h);
    pen.clip();
    for (const s of list) {
      style(s, { members: 0.25, band: 0.22, line: 1 }[s.kind]);
      if (s.kind === "band") {
        pen.beginPath();
        points(s.values[0], 0).concat(points(s.values[1], 0).reverse()).forEach(at => pen.lineTo(...at));
        pen.fill();
      } else {
        for (let m = 0; m < s.values[0].length; m += c.steps) { line(...points(s.values[0], m)); }
      }
    }
    style({ colour: "#56606b" }, 1);
    if (cursor !== null) { line([xt(cursor), margin.top], [xt(cursor), height - margin.bottom]); }
    if (drag && drag.to !== null) {
      style({ colour: "#0072b2" }, 0.12);
      pen.fillRect(xt(drag.from), margin.top, xt(drag.to) - xt(drag.from), inner.h);
    }
    pen.restore();
    legend(list, width);
    Object.assign(canvas.dataset, {
      range: span.map(t => t.toFixed(4)).join(" "), channel: channel().name, cell: c.label,
      drawn: list.map(s => s.kind).join(" "), legend: list.map(s => s.label).join(", "),
    });
    const i = cursor === null ? -1 : Math.min(Math.max(Math.round(cursor / c.step) - 1, 0), c.steps - 1);
    const told = list.filter(s => s.kind !== "members").map(s => s.label + " " + s.values.map(v => v[i]?.toPrecision(4)).join(" to "));
    readout.textContent = i < 0 ? c.note : ["t = " + (c.step * (i + 1)).toFixed(2) + " s", ...told].join("   ");
  }
  function frame(span, bounds, xt, y, width, height) {
    style({ colour: "#e3e7ea" }, 1);
    const across = ticks(...span, Math.max(3, width / 120)), up = ticks(...bounds, 6);
    for (const v of across.values) { line([xt(v), margin.top], [xt(v), height - margin.bottom]); }
    for (const v of up.values) { line([margin.left, y(v)], [width - margin.right, y(v)]); }
    pen.fillStyle = "#1b2430";
    pen.textAlign = "right";
    for (const v of up.values) { pen.fillText(v.toFixed(up.digits), margin.left - 6, y(v) + 4); }
    pen.textAlign = "center";
    for (const v of across.values) { pen.fillText(v.toFixed(across.digits), xt(v), height - margin.bottom + 16); }
    pen.fillText("time after the last measured state [s]", (width + margin.left) / 2, height - 6);
    pen.save();
    pen.translate(13, height / 2);
    pen.rotate(-Math.PI / 2);
    pen.fillText(channel().label + " [" + channel().unit + "]", 0, 0);
    pen.restore();
  }
  function legend(list, width) {             // above the plot, as the lines are drawn
    let at = width - margin.right;
    pen.textAlign = "left";
    for (const s of list.slice().reverse()) {
      at -= pen.measureText(s.label).width;
      style({ colour: "#1b2430" }, 1);
      pen.fillText(s.label, at, 20);
      style(s, s.kind === "band" ? 0.22 : 1);
      if (s.kind === "band") { pen.fillRect(at - 36, 10, 30, 12); } else { line([at - 36, 16], [at - 6, 16]); }
      at -= 50;
    }
    style({ colour: "#000000" }, 1);
  }

  const show = (low, high) => {
    const [begin, end] = whole();
    if (high - low < 8 * cell().step) { return; }
    range = low <= begin && high >= end ? null : [Math.max(low, begin), Math.min(high, end)];
    draw();
  };
  const zoom = (factor, centre) => {
    const [low, high] = range || whole(), at = centre ?? (low + high) / 2;
    show(at - (at - low) * factor, at + (high - at) * factor);
  };
  const shift = part => {
    const [begin, end] = whole(), [low, high] = range || whole(), width = high - low;
    const to = Math.min(Math.max(low + part * width, begin), end - width);
    show(to, to + width);
  };
  const acts = {
    "+": () => zoom(0.6), "=": () => zoom(0.6), "-": () => zoom(1 / 0.6), "0": () => show(...whole()),
    ArrowLeft: () => shift(-0.25), ArrowRight: () => shift(0.25),
  };
  const instant = event => {
    const part = (event.clientX - canvas.getBoundingClientRect().left - margin.left) / plot.inner.w;
    return plot.span[0] + Math.min(Math.max(part, 0), 1) * (plot.span[1] - plot.span[0]);
  };
  const on = (target, kind, act, options) => target.addEventListener(kind, act, options);
  on(canvas, "pointerdown", event => { drag = { from: instant(event), to: null }; canvas.setPointerCapture(event.pointerId); });
  on(canvas, "pointermove", event => { cursor = instant(event); if (drag) { drag.to = cursor; } draw(); });
  on(canvas, "pointerup", () => {
    const done = drag;
    drag = null;
    if (done && done.to !== null) { show(Math.min(done.from, done.to), Math.max(done.from, done.to)); }
    draw();
  });
  on(canvas, "pointerleave", () => { if (!drag) { cursor = null; draw(); } });
  on(canvas, "dblclick", acts["0"]);
  on(canvas, "wheel", event => {
    if (!event.ctrlKey && !event.shiftKey) { return; }  // a bare wheel scrolls the page
    event.preventDefault();
    zoom(event.deltaY > 0 || event.deltaX > 0 ? 1.25 : 0.8, instant(event));
  }, { passive: false });
  on(canvas, "keydown", event => { if (acts[event.key]) { event.preventDefault(); acts[event.key](); } });
  document.querySelectorAll("button[data-act]").forEach(button => on(button, "click", acts[button.dataset.act]));
  boxes.forEach(box => on(box, "change", draw));
  const channels = () => fill(pick.channel, cell().channels.map(c => c.label));
  on(pick.cell, "change", () => { range = null; channels(); draw(); });
  on(pick.channel, "change", draw);
  on(window, "resize", draw);
  fill(pick.cell, cells.map(c => c.label));
  channels();
  draw();
})();
