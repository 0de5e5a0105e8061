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
  const data = JSON.parse(holder.textContent), opening = data.open;
  const cells = window.seakeepCells = {};    // by "TEST-TRAINING", then by window; filled by scripts
  const canvas = document.getElementById("history"), pen = canvas.getContext("2d");
  const pick = Object.fromEntries(["test", "training", "window", "channel"].map(key => [key, document.getElementById("pick-" + key)]));
  const boxes = Array.from(document.querySelectorAll("#history-show input"));
  const readout = document.getElementById("history-readout");
  const margin = { left: 70, right: 14, top: 34, bottom: 40 }, strip = 96;   // strip: height of the waves
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
  const test = () => data.tests[pick.test.selectedIndex];
  const channel = () => data.channels[pick.channel.selectedIndex];
  const place = () => [pick.test.selectedIndex, +pick.training.value, +pick.window.value];
  const key = () => test().name + "-" + pick.training.value;
  const cell = () => {
    const first = place().join() === [opening.test, opening.training, opening.window].join();
    return first ? opening.cell : (cells[key()] || {})[pick.window.value];
  };
  const whole = () => [data.step, data.step * test().steps];
  const fill = (select, entries, wanted) => {  // entries: [value, label]
    const before = wanted ?? select.value;
    select.replaceChildren(...entries.map(([value, label]) => new Option(label, value)));
    select.value = entries.some(([value]) => String(value) === String(before)) ? before : entries[0][0];
  };
  const shown = name => boxes.some(box => box.value === name && box.checked);
  const series = () => {                     // what is shown, in the order it is drawn
    const out = [], c = cell(), k = pick.channel.selectedIndex;
    const line = (kind, m, values, label, more) => out.push({ kind, colour: m.colour, dash: m.dash, values: values.map(numbers), label, ...more });
    for (const m of data.models) {
      const found = c.models[m.name], plain = { ...m, dash: [] };
      if (found.lower && shown("band")) { line("band", plain, [found.lower[k], found.upper[k]], m.label + " band"); }
    }
    if (shown("measured")) { line("line", { colour: "#000000" }, [c.measured[k]], "measured", { width: 1.8 }); }
    if (shown("models")) {
      for (const m of data.models) { line("line", m, [c.models[m.name].mean[k]], m.mean, { width: 1.4, nrmse: c.models[m.name].nrmse[k] }); }
    }
    return out;
  };
  const waves = () => shown("waves") ? data.waves.map((w, i) => ({
    kind: "line", colour: ["#56606b", "#9aa4ae"][i % 2], width: 1, dash: i ? [3, 2] : [], values: [numbers(cell().waves[i])], label: w.label,
  })) : [];
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
    if (!cell()) { return; }
    const span = range || whole(), list = series(), sea = waves(), steps = test().steps;
    const bottom = height - margin.bottom - (sea.length ? strip : 0);
    const inner = { w: width - margin.left - margin.right };
    const xt = t => margin.left + inner.w * (t - span[0]) / (span[1] - span[0]);
    plot = { span, inner };
    panel(list, span, xt, margin.top, bottom, steps, width, channel(), 6);
    if (sea.length) { panel(sea, span, xt, bottom + 22, height - margin.bottom, steps, width, { label: "waves", unit: data.waves[0].unit }, 3); }
    times(span, xt, width, height);
    style({ colour: "#56606b" }, 1);
    if (cursor !== null) { line([xt(cursor), margin.top], [xt(cursor), height - margin.bottom]); }
    if (drag && drag.to !== null) {
      style({ colour: "#0072b2" }, 0.12);
      pen.fillRect(xt(drag.from), margin.top, xt(drag.to) - xt(drag.from), height - margin.bottom - margin.top);
    }
    style({ colour: "#000000" }, 1);
    legend(list, width);
    Object.assign(canvas.dataset, {
      range: span.map(t => t.toFixed(4)).join(" "), channel: channel().name, cell: key() + "-" + pick.window.value,
      drawn: [...list, ...sea].map(s => s.kind).join(" "), legend: list.map(s => s.label).join(", "),
    });
    tell(list, sea, steps);
  }
  function tell(list, sea, steps) {          // errors of the window, or values at the cursor
    const i = cursor === null ? -1 : Math.min(Math.max(Math.round(cursor / data.step) - 1, 0), steps - 1);
    const value = (s, unit) => s.label + " " + s.values.map(v => v[i]?.toPrecision(4)).join(" to ") + " " + unit;
    const errors = list.filter(s => s.nrmse != null).map(s => s.label + " " + s.nrmse.toFixed(3));
    const told = i < 0 ? ["NRMSE of " + channel().label + " in this window: " + (errors.join(", ") || "not judged")]
      : ["t = " + (data.step * (i + 1)).toFixed(2) + " s", ...list.map(s => value(s, channel().unit)),
        ...sea.map(s => value(s, data.waves[0].unit))];
    readout.textContent = told.join("   ");
  }
  function panel(list, span, xt, top, bottom, steps, width, axis, count) {
    const first = Math.max(0, Math.floor(span[0] / data.step) - 1), last = Math.min(steps - 1, Math.ceil(span[1] / data.step) - 1);
    let low = Infinity, high = -Infinity;
    for (const values of list.flatMap(s => s.values)) {
      values.forEach((v, i) => { if (i % steps >= first && i % steps <= last && v === v) { low = Math.min(low, v); high = Math.max(high, v); } });
    }
    if (!(low < high)) { low = (isFinite(low) ? low : 0) - 1; high = low + 2; }
    [low, high] = [low - 0.06 * (high - low), high + 0.06 * (high - low)];
    const y = v => top + (bottom - top) * (high - v) / (high - low), up = ticks(low, high, count);
    const points = (values, offset) => Array.from({ length: last - first + 1 }, (_, k) => [xt(data.step * (first + k + 1)), y(values[offset + first + k])]);
    style({ colour: "#e3e7ea" }, 1);
    for (const v of ticks(...span, Math.max(3, width / 120)).values) { line([xt(v), top], [xt(v), bottom]); }
    for (const v of up.values) { line([margin.left, y(v)], [width - margin.right, y(v)]); }
    pen.fillStyle = "#1b2430";
    pen.textAlign = "right";
    for (const v of up.values) { pen.fillText(v.toFixed(up.digits), margin.left - 6, y(v) + 4); }
    pen.save();
    pen.translate(13, (top + bottom) / 2);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText(axis.label + " [" + axis.unit + "]", 0, 0);
    pen.restore();
    pen.save();
    pen.beginPath();
    pen.rect(margin.left, top, width - margin.left - margin.right, bottom - top);
    pen.clip();
    for (const s of list) {
      style(s, { band: 0.22, line: 1 }[s.kind]);
      if (s.kind === "band") {
        pen.beginPath();
        points(s.values[0], 0).concat(points(s.values[1], 0).reverse()).forEach(at => pen.lineTo(...at));
        pen.fill();
      } else {
        for (let m = 0; m < s.values[0].length; m += steps) { line(...points(s.values[0], m)); }
      }
    }
    pen.restore();
  }
  function times(span, xt, width, height) {
    const across = ticks(...span, Math.max(3, width / 120));
    style({ colour: "#1b2430" }, 1);
    pen.textAlign = "center";
    for (const v of across.values) { pen.fillText(v.toFixed(across.digits), xt(v), height - margin.bottom + 16); }
    pen.fillText("time after the last measured state [s]", (width + margin.left) / 2, height - 6);
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
    if (high - low < 8 * data.step) { return; }
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
  const load = () => {                       // draw the cell that is chosen, once its script is there
    if (cell()) { draw(); return; }
    const asked = key(), script = document.createElement("script");
    readout.textContent = "Loading …";
    script.src = "histories/" + asked + ".js";
    script.onload = () => { if (key() === asked) { draw(); } };
    script.onerror = () => { readout.textContent = "histories/" + asked + ".js does not lie beside this page; only the window that it opens with is in the page."; };
    document.head.append(script);
  };
  const windows = wanted => {
    const of = test(), judged = of.judged[+pick.training.value];
    fill(pick.window, of.windows.map((label, i) => [i, label]).filter(([i]) => judged[i]), wanted);
  };
  const sets = (training, window) => {
    const of = test();
    fill(pick.training, of.training.map((label, i) => [i, label]).filter(([i]) => of.judged[i].some(Boolean)), training);
    windows(window);
  };
  on(pick.test, "change", () => { range = null; sets(); load(); });
  on(pick.training, "change", () => { windows(); load(); });
  on(pick.window, "change", load);
  on(pick.channel, "change", draw);
  on(window, "resize", draw);
  fill(pick.test, data.tests.map((t, i) => [i, t.label]), opening.test);
  fill(pick.channel, data.channels.map((c, i) => [i, c.label]), opening.channel);
  sets(opening.training, opening.window);
  draw();
})();
