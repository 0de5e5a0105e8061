"use strict";
(function () {
  // --- tables that can be copied -------------------------------------------------------------
  function tableText(table) {
    return Array.from(table.rows, function (row) {
      return Array.from(row.cells, function (cell) { return cell.textContent.trim(); }).join("\t");
    }).join("\n");
  }
  function copyOldWay(text) {
    var area = document.createElement("textarea");
    area.value = text;
    area.style.position = "fixed";
    area.style.opacity = "0";
    document.body.appendChild(area);
    area.select();
    var done = document.execCommand("copy");
    area.remove();
    return done;
  }
  function copy(button) {
    var text = tableText(button.closest(".table").querySelector("table"));
    function tell(done) {
      button.textContent = done ? "Copied" : "Select and copy by hand";
      window.setTimeout(function () { button.textContent = "Copy table"; }, 2000);
    }
    button.dataset.copied = text;
    if (navigator.clipboard && window.isSecureContext) {
      navigator.clipboard.writeText(text).then(
        function () { tell(true); }, function () { tell(copyOldWay(text)); });
    } else {
      tell(copyOldWay(text));
    }
  }
  document.querySelectorAll("button.copy").forEach(function (button) {
    button.addEventListener("click", function () { copy(button); });
  });

  // --- time histories -------------------------------------------------------------------------
  var holder = document.getElementById("history-data");
  if (!holder) { return; }
  var cells = JSON.parse(holder.textContent);
  var canvas = document.getElementById("history");
  var context = canvas.getContext("2d");
  var pick = { cell: document.getElementById("pick-cell"), channel: document.getElementById("pick-channel") };
  var show = {};
  document.querySelectorAll("#history-show input").forEach(function (input) {
    show[input.value] = input.checked;
    input.addEventListener("change", function () { show[input.value] = input.checked; draw(); });
  });
  var readout = document.getElementById("history-readout");
  var range = null, cursor = null, drag = null;
  var margin = { left: 70, right: 14, top: 34, bottom: 40 };

  function numbers(packed) {                  // 16-bit integers between two bounds, base64
    if (packed.values) { return packed.values; }
    var bytes = Uint8Array.from(atob(packed.data), function (c) { return c.charCodeAt(0); });
    var view = new DataView(bytes.buffer), count = bytes.length / 2, out = new Float64Array(count);
    var step = (packed.high - packed.low) / 65534;
    for (var i = 0; i < count; i++) {
      var raw = view.getUint16(2 * i, true);
      out[i] = raw === 65535 ? NaN : packed.low + step * raw;
    }
    packed.values = out;
    return out;
  }
  function cell() { return cells[pick.cell.selectedIndex]; }
  function channel() { return cell().channels[pick.channel.selectedIndex]; }
  function whole() { return [cell().step, cell().step * cell().steps]; }
  function fill(select, labels) {
    var before = Math.max(select.selectedIndex, 0);
    select.replaceChildren.apply(select, labels.map(function (label) { return new Option(label); }));
    select.selectedIndex = Math.min(before, labels.length - 1);
  }
  function series() {                         // what is shown, in the order it is drawn
    var c = channel(), out = [];
    c.models.forEach(function (m) {
      if (m.members && show.members) { out.push({ kind: "members", model: m, values: numbers(m.members) }); }
      if (m.lower && show.band) {
        out.push({ kind: "band", model: m, lower: numbers(m.lower), upper: numbers(m.upper) });
      }
    });
    if (show.measured) { out.push({ kind: "line", colour: "#000000", width: 1.8, values: numbers(c.measured), label: "measured" }); }
    c.models.forEach(function (m) {
      if (show.models) { out.push({ kind: "line", colour: m.colour, width: 1.4, dash: m.dash, values: numbers(m.mean), label: m.label }); }
    });
    return out;
  }
  function extent(list, first, last) {
    var low = Infinity, high = -Infinity, steps = cell().steps;
    list.forEach(function (s) {
      [s.values, s.lower, s.upper].forEach(function (values) {
        if (!values) { return; }
        for (var i = 0; i < values.length; i++) {
          var k = i % steps, v = values[i];
          if (k >= first && k <= last && v === v) { low = Math.min(low, v); high = Math.max(high, v); }
        }
      });
    });
    if (!(low < high)) { low = (isFinite(low) ? low : 0) - 1; high = low + 2; }
    var room = 0.06 * (high - low);
    return [low - room, high + room];
  }
  function ticks(low, high, count) {
    var raw = (high - low) / count, power = Math.pow(10, Math.floor(Math.log10(raw)));
    var step = [1, 2, 5, 10].map(function (f) { return f * power; }).find(function (s) { return s >= raw; });
    var out = [];
    for (var v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) { out.push(v); }
    return { values: out, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  }
  function path(values, offset, first, last, x, y) {
    context.beginPath();
    for (var i = first, open = false; i <= last; i++) {
      var v = values[offset + i];
      if (v !== v) { open = false; continue; }
      if (open) { context.lineTo(x(i), y(v)); } else { context.moveTo(x(i), y(v)); open = true; }
    }
  }
  var scale = null;
  function draw() {
    var ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    var c = cell(), span = range || whole(), list = series();
    var first = Math.max(0, Math.floor(span[0] / c.step) - 1);
    var last = Math.min(c.steps - 1, Math.ceil(span[1] / c.step) - 1);
    var bounds = extent(list, first, last);
    var inner = { w: width - margin.left - margin.right, h: height - margin.top - margin.bottom };
    function xt(t) { return margin.left + inner.w * (t - span[0]) / (span[1] - span[0]); }
    function x(i) { return xt(c.step * (i + 1)); }
    function y(v) { return margin.top + inner.h * (bounds[1] - v) / (bounds[1] - bounds[0]); }
    scale = { span: span, inner: inner, xt: xt };
    grid(span, bounds, xt, y, width, height);
    context.save();
    context.beginPath();
    context.rect(margin.left, margin.top, inner.w, inner.h);
    context.clip();
    list.forEach(function (s) { paint(s, first, last, x, y); });
    if (cursor !== null) { vertical(xt(cursor), "#56606b"); }
    if (drag && drag.to !== null) {
      context.fillStyle = "rgba(0,114,178,.12)";
      context.fillRect(Math.min(xt(drag.from), xt(drag.to)), margin.top, Math.abs(xt(drag.to) - xt(drag.from)), inner.h);
    }
    context.restore();
    legend(list, width);
    canvas.dataset.range = span[0].toFixed(4) + " " + span[1].toFixed(4);
    canvas.dataset.channel = channel().name;
    canvas.dataset.cell = c.label;
    canvas.dataset.drawn = list.map(function (s) { return s.kind; }).join(" ");
    tell();
  }
  function legend(list, width) {              // above the plot, as the lines are drawn
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "left";
    var entries = list.map(function (s) {
      return { series: s, label: s.label || s.model.label.replace(/ mean$/, "") + " " + s.kind };
    });
    var at = width - margin.right;
    entries.reverse().forEach(function (entry) {
      var s = entry.series;
      at -= context.measureText(entry.label).width;
      context.fillStyle = "#1b2430";
      context.fillText(entry.label, at, 20);
      context.strokeStyle = context.fillStyle = s.colour || s.model.colour;
      context.globalAlpha = s.kind === "band" ? 0.22 : 1;
      if (s.kind === "band") {
        context.fillRect(at - 36, 10, 30, 12);
      } else {
        stroke(s);
        context.beginPath();
        context.moveTo(at - 36, 16);
        context.lineTo(at - 6, 16);
        context.stroke();
        context.setLineDash([]);
      }
      context.globalAlpha = 1;
      at -= 50;
    });
    canvas.dataset.legend = entries.reverse().map(function (entry) { return entry.label; }).join(", ");
  }
  function stroke(s) {                        // width, and dashes in widths
    context.lineWidth = s.width || 0.7;
    context.setLineDash((s.dash || []).map(function (d) { return d * context.lineWidth; }));
  }
  function vertical(at, colour) {
    context.strokeStyle = colour;
    context.lineWidth = 0.8;
    context.beginPath();
    context.moveTo(at, margin.top);
    context.lineTo(at, canvas.clientHeight - margin.bottom);
    context.stroke();
  }
  function grid(span, bounds, xt, y, width, height) {
    context.font = "12px system-ui, sans-serif";
    context.fillStyle = "#1b2430";
    context.strokeStyle = "#e3e7ea";
    context.lineWidth = 1;
    var horizontal = ticks(span[0], span[1], Math.max(3, width / 120));
    context.textAlign = "center";
    horizontal.values.forEach(function (v) {
      context.beginPath(); context.moveTo(xt(v), margin.top); context.lineTo(xt(v), height - margin.bottom); context.stroke();
      context.fillText(v.toFixed(horizontal.digits), xt(v), height - margin.bottom + 16);
    });
    var vertical = ticks(bounds[0], bounds[1], 6);
    context.textAlign = "right";
    vertical.values.forEach(function (v) {
      context.beginPath(); context.moveTo(margin.left, y(v)); context.lineTo(width - margin.right, y(v)); context.stroke();
      context.fillText(v.toFixed(vertical.digits), margin.left - 6, y(v) + 4);
    });
    context.textAlign = "center";
    context.fillText("time after the last measured state [s]", (width + margin.left) / 2, height - 6);
    context.save();
    context.translate(13, height / 2);
    context.rotate(-Math.PI / 2);
    context.fillText(channel().label + " [" + channel().unit + "]", 0, 0);
    context.restore();
  }
  function paint(s, first, last, x, y) {
    stroke(s);
    if (s.kind === "members") {
      context.strokeStyle = s.model.colour;
      context.globalAlpha = 0.25;
      for (var m = 0; m < s.values.length / cell().steps; m++) {
        path(s.values, m * cell().steps, first, last, x, y);
        context.stroke();
      }
    } else if (s.kind === "band") {
      context.fillStyle = s.model.colour;
      context.globalAlpha = 0.22;
      context.beginPath();
      for (var i = first; i <= last; i++) { context.lineTo(x(i), y(s.upper[i])); }
      for (var k = last; k >= first; k--) { context.lineTo(x(k), y(s.lower[k])); }
      context.fill();
    } else {
      context.strokeStyle = s.colour;
      path(s.values, 0, first, last, x, y);
      context.stroke();
    }
    context.globalAlpha = 1;
    context.setLineDash([]);
  }
  function tell() {
    var c = cell(), text = c.note;
    if (cursor !== null) {
      var i = Math.min(Math.max(Math.round(cursor / c.step) - 1, 0), c.steps - 1);
      text = "t = " + (c.step * (i + 1)).toFixed(2) + " s";
      series().forEach(function (s) {
        if (s.kind === "line") { text += "   " + s.label + " " + s.values[i].toPrecision(4); }
        if (s.kind === "band") { text += "   band " + s.lower[i].toPrecision(4) + " to " + s.upper[i].toPrecision(4); }
      });
    }
    readout.textContent = text;
  }
  function zoom(factor, centre) {
    var span = range || whole(), all = whole();
    var at = centre === undefined ? (span[0] + span[1]) / 2 : centre;
    var low = Math.max(all[0], at - (at - span[0]) * factor);
    var high = Math.min(all[1], at + (span[1] - at) * factor);
    if (high - low < 8 * cell().step) { return; }
    range = low <= all[0] && high >= all[1] ? null : [low, high];
    draw();
  }
  function shift(part) {
    if (!range) { return; }
    var all = whole(), width = range[1] - range[0];
    var low = Math.min(Math.max(range[0] + part * width, all[0]), all[1] - width);
    range = [low, low + width];
    draw();
  }
  function reset() { range = null; draw(); }
  function instant(event) {
    var box = canvas.getBoundingClientRect();
    var part = (event.clientX - box.left - margin.left) / scale.inner.w;
    return scale.span[0] + Math.min(Math.max(part, 0), 1) * (scale.span[1] - scale.span[0]);
  }
  canvas.addEventListener("pointerdown", function (event) {
    drag = { from: instant(event), to: null };
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", function (event) {
    cursor = instant(event);
    if (drag) { drag.to = cursor; }
    draw();
  });
  canvas.addEventListener("pointerup", function () {
    var done = drag;
    drag = null;
    if (done && done.to !== null && Math.abs(done.to - done.from) > 8 * cell().step) {
      range = [Math.min(done.from, done.to), Math.max(done.from, done.to)];
    }
    draw();
  });
  canvas.addEventListener("pointerleave", function () { if (!drag) { cursor = null; draw(); } });
  canvas.addEventListener("dblclick", reset);
  canvas.addEventListener("wheel", function (event) {
    if (!event.ctrlKey && !event.shiftKey) { return; }  // a bare wheel scrolls the page
    event.preventDefault();
    zoom(event.deltaY > 0 || event.deltaX > 0 ? 1.25 : 0.8, instant(event));
  }, { passive: false });
  canvas.addEventListener("keydown", function (event) {
    var act = { "+": function () { zoom(0.6); }, "=": function () { zoom(0.6); }, "-": function () { zoom(1 / 0.6); },
      "0": reset, ArrowLeft: function () { shift(-0.25); }, ArrowRight: function () { shift(0.25); } }[event.key];
    if (act) { event.preventDefault(); act(); }
  });
  document.getElementById("zoom-in").addEventListener("click", function () { zoom(0.6); });
  document.getElementById("zoom-out").addEventListener("click", function () { zoom(1 / 0.6); });
  document.getElementById("zoom-left").addEventListener("click", function () { shift(-0.25); });
  document.getElementById("zoom-right").addEventListener("click", function () { shift(0.25); });
  document.getElementById("zoom-reset").addEventListener("click", reset);
  pick.cell.addEventListener("change", function () {
    range = null;
    fill(pick.channel, cell().channels.map(function (c) { return c.label; }));
    draw();
  });
  pick.channel.addEventListener("change", draw);
  window.addEventListener("resize", draw);
  fill(pick.cell, cells.map(function (c) { return c.label; }));
  fill(pick.channel, cell().channels.map(function (c) { return c.label; }));
  draw();
})();
