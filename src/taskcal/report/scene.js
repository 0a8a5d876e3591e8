// Draws scenes in space on canvases: robots as tubes and cylinders, points, arrows and strokes, farthest first. No WebGL is
// needed, so that a scene shows on a remote desktop, in a virtual machine and on paper as well.
"use strict";
(() => {
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const add = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const length = (a) => Math.hypot(a[0], a[1], a[2]);
  const unit = (a) => { const l = length(a) || 1; return [a[0] / l, a[1] / l, a[2] / l]; };
  const SIDES = 14;

  // Viridis, which is even in grey as well.
  const SCALE = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
  function shade(share) {
    const x = Math.min(Math.max(share, 0), 1) * (SCALE.length - 1), k = Math.min(Math.floor(x), SCALE.length - 2);
    return `rgb(${SCALE[k].map((c, i) => Math.round(c + (x - k) * (SCALE[k + 1][i] - c))).join(",")})`;
  }

  function ring(centre, axis, radius) {
    const n = unit(axis), u = unit(cross(n, Math.abs(n[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0])), v = cross(n, u);
    return Array.from({ length: SIDES }, (_, k) => {
      const a = (2 * Math.PI * k) / SIDES;
      return add(add(centre, u, radius * Math.cos(a)), v, radius * Math.sin(a));
    });
  }
  function tube(out, from, to, radius, colour, capped) {
    const axis = sub(to, from);
    if (length(axis) < 1e-6) return;
    const a = ring(from, axis, radius), b = ring(to, axis, radius);
    for (let k = 0; k < SIDES; k++) {
      const next = (k + 1) % SIDES;
      out.push({ face: [a[k], a[next], b[next], b[k]], colour });
    }
    if (capped) out.push({ face: [...a].reverse(), colour }, { face: b, colour });
  }
  function ball(out, centre, radius, colour) {
    const rows = 5;
    const level = (r) => ring(add(centre, [0, 0, radius * Math.sin(Math.PI * (r / rows - 0.5))]), [0, 0, 1], radius * Math.cos(Math.PI * (r / rows - 0.5)));
    for (let r = 0; r < rows; r++) {
      const low = level(r), high = level(r + 1);
      for (let k = 0; k < SIDES; k += 1) {
        const next = (k + 1) % SIDES;
        out.push({ face: [low[k], low[next], high[next], high[k]], colour });
      }
    }
  }
  function robot(out, pose, look, colours) {
    pose.links.forEach((corners, number) => {
      const thick = look.links[number];
      for (let k = 0; k + 1 < corners.length; k++) tube(out, corners[k], corners[k + 1], thick, colours.link, false);
      for (let k = 1; k + 1 < corners.length; k++) ball(out, corners[k], thick, colours.link);
    });
    pose.joints.forEach(([centre, axis], number) => {
      const half = look.halves[number];
      tube(out, add(centre, axis, -half), add(centre, axis, half), look.drums[number], colours.joint, true);
    });
    for (const [from, to] of pose.loop) {
      tube(out, from, to, look.bar, colours.loop, true);
      ball(out, from, look.pin, colours.loop);
      ball(out, to, look.pin, colours.loop);
    }
    const tool = pose.links[pose.links.length - 1];
    ball(out, tool[tool.length - 1], look.tool, colours.tool);
  }

  function extent(scene) {
    const points = [];
    for (const pose of scene.poses) for (const link of pose.links) points.push(...link);
    for (const layer of scene.layers) {
      if (layer.kind === "strokes") for (const stroke of layer.at) points.push(...stroke);
      else points.push(...layer.at);
    }
    const low = [0, 1, 2].map((i) => points.reduce((m, p) => Math.min(m, p[i]), Infinity));
    const high = [0, 1, 2].map((i) => points.reduce((m, p) => Math.max(m, p[i]), -Infinity));
    const centre = low.map((l, i) => 0.5 * (l + high[i]));
    return { low, high, centre, radius: Math.max(points.reduce((m, p) => Math.max(m, length(sub(p, centre))), 0), 1) };
  }

  // Colours of a dark screen: those that the page's charts have, its ink for all others. Paper is always white.
  const night = window.matchMedia("screen and (prefers-color-scheme: dark)"), probe = document.createElement("i");
  probe.hidden = true; document.body.append(probe);
  let paper = document.documentElement.dataset.export;
  const isDark = () => night.matches && !paper;
  function tone(colour, dark) {
    if (!isDark()) return colour;
    if (dark) return dark;
    probe.className = `c-${colour.slice(1)}`;
    return getComputedStyle(probe).color;
  }

  function drawScene(holder) {
    const scene = JSON.parse(holder.textContent), box = document.getElementById(holder.dataset.scene);
    const canvas = box.querySelector("canvas"), tip = box.querySelector(".tip"), label = box.querySelector(".legend");
    const view = { turn: -0.9, tilt: 0.35, zoom: 1 }, hidden = new Set(), room = extent(scene);
    const material = Object.fromEntries(Object.entries(scene.look?.colours ?? {}).map(([part, hex]) => [part, [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16))]));
    let number = scene.shown || 0, scale = scene.scale ? scene.scale.start : 1, seen = [];

    function grid(out) {
      const decade = 10 ** Math.floor(Math.log10(room.radius)), step = decade * (room.radius / decade < 3 ? 0.5 : 1);
      const z = scene.floor ? 0 : room.low[2];
      const first = [0, 1].map((i) => Math.floor(room.low[i] / step) * step), last = [0, 1].map((i) => Math.ceil(room.high[i] / step) * step);
      for (let x = first[0]; x <= last[0] + 1e-6; x += step) out.push({ line: [[x, first[1], z], [x, last[1], z]], colour: tone("#dde2e7", "#333e48"), width: 1, far: true });
      for (let y = first[1]; y <= last[1] + 1e-6; y += step) out.push({ line: [[first[0], y, z], [last[0], y, z]], colour: tone("#dde2e7", "#333e48"), width: 1, far: true });
      return step;
    }
    function layer(out, one) {
      const style = { colour: tone(one.colour || "#1f2933"), width: one.width || 2, dash: one.dash };
      if (one.kind === "strokes") {
        for (const stroke of one.at) for (let k = 0; k + 1 < stroke.length; k++) out.push({ line: [stroke[k], stroke[k + 1]], ...style });
      } else if (one.kind === "arrows") {
        one.at.forEach((at, k) => {
          const to = add(at, one.by[k], scale);
          out.push({ line: [at, to], head: true, ...style });
        });
      } else if (one.kind === "marker") {
        out.push({ dot: one.at[0], size: 6, colour: style.colour, square: true });
        out.push({ dot: one.at[0], size: 0, beside: 9, text: one.label, top: true });  // what stands before it would cut it
      } else {
        one.at.forEach((at, k) => out.push({
          dot: at, size: one.size || 3, square: one.square, tip: one.tips ? one.tips[k] : "",
          colour: one.values ? shade((one.values[k] - one.least) / (one.most - one.least || 1)) : style.colour,
        }));
      }
    }

    function draw() {
      const wide = box.clientWidth, high = Math.round(Math.min(Math.max(wide * 0.62, 300), 640)), fine = Math.max(window.devicePixelRatio || 1, 2);
      if (!wide) return;
      canvas.width = wide * fine; canvas.height = high * fine; canvas.style.aspectRatio = `${wide} / ${high}`;
      const pen = canvas.getContext("2d"), n = [Math.cos(view.tilt) * Math.cos(view.turn), Math.cos(view.tilt) * Math.sin(view.turn), Math.sin(view.tilt)];
      const right = [-Math.sin(view.turn), Math.cos(view.turn), 0], up = cross(n, right), distance = 3.2 * room.radius;
      const focus = (0.5 * Math.min(high * 1.06, wide) * distance) / room.radius * view.zoom;
      const eye = add(room.centre, n, distance), light = unit(add(add(n, up, 0.9), right, -0.6));
      const project = (p) => {
        const d = sub(p, room.centre), depth = distance - dot(d, n), k = focus / Math.max(depth, 0.05 * distance);
        return [wide / 2 + k * dot(d, right), high / 2 - k * dot(d, up), depth];
      };
      const parts = [];
      const step = grid(parts);
      if (scene.poses.length && !hidden.has("robot")) robot(parts, scene.poses[number], scene.look, material);
      for (const one of scene.layers) if (!hidden.has(one.label)) layer(parts, one);
      const size = 0.12 * room.radius;
      if (scene.floor) [["x", [1, 0, 0]], ["y", [0, 1, 0]], ["z", [0, 0, 1]]].forEach(([name, axis]) => {
        const end = axis.map((a) => a * size * 1.6);
        parts.push({ line: [[0, 0, 0], end], colour: tone("#1f2933"), width: 1.5, head: true, near: true }, { dot: axis.map((a) => a * size * 1.85), size: 0, text: name, colour: tone("#1f2933"), near: true });
      });
      pen.setTransform(fine, 0, 0, fine, 0, 0);
      pen.fillStyle = tone("#ffffff", "#12181e"); pen.fillRect(0, 0, wide, high);
      pen.lineJoin = "round"; pen.lineCap = "round";
      seen = [];
      for (const part of parts) {
        const points = part.face || part.line || [part.dot];
        part.flat = points.map(project);
        part.depth = part.flat.reduce((sum, p) => sum + p[2], 0) / points.length + (part.far ? 1e9 : 0) - (part.near ? 0.02 * distance : 0) - (part.top ? 1e9 : 0);
        if (part.face) {
          const normal = unit(cross(sub(points[1], points[0]), sub(points[2], points[0])));
          part.away = dot(normal, sub(eye, points[0])) <= 0;
          const bright = 0.5 + 0.5 * Math.max(0, dot(normal, light));
          part.fill = `rgb(${part.colour.map((c) => Math.round(c * bright)).join(",")})`;
        }
      }
      parts.sort((a, b) => b.depth - a.depth);
      for (const part of parts) {
        const [first] = part.flat;
        pen.setLineDash(part.dash ? [5, 4] : []);
        if (part.face) {
          if (part.away) continue;
          pen.beginPath(); part.flat.forEach((p, k) => (k ? pen.lineTo(p[0], p[1]) : pen.moveTo(p[0], p[1]))); pen.closePath();
          pen.fillStyle = pen.strokeStyle = part.fill; pen.lineWidth = 0.7; pen.fill(); pen.stroke();
        } else if (part.line) {
          const end = part.flat[1], along = Math.hypot(end[0] - first[0], end[1] - first[1]);
          pen.strokeStyle = pen.fillStyle = part.colour; pen.lineWidth = part.width;
          pen.beginPath(); pen.moveTo(first[0], first[1]); pen.lineTo(end[0], end[1]); pen.stroke();
          if (part.head && along > 4) {
            const a = Math.atan2(end[1] - first[1], end[0] - first[0]), s = Math.min(7, 0.5 * along);
            pen.setLineDash([]); pen.beginPath(); pen.moveTo(end[0], end[1]);
            pen.lineTo(end[0] - s * Math.cos(a - 0.45), end[1] - s * Math.sin(a - 0.45)); pen.lineTo(end[0] - s * Math.cos(a + 0.45), end[1] - s * Math.sin(a + 0.45));
            pen.closePath(); pen.fill();
          }
        } else {
          pen.fillStyle = part.colour; pen.strokeStyle = tone("#ffffff", "#12181e"); pen.lineWidth = 0.8;
          pen.beginPath();
          if (part.square) pen.rect(first[0] - part.size, first[1] - part.size, 2 * part.size, 2 * part.size);
          else pen.arc(first[0], first[1], part.size, 0, 2 * Math.PI);
          if (part.size) { pen.fill(); pen.stroke(); }
          if (part.text) {
            pen.fillStyle = tone("#1f2933"); pen.font = "13px system-ui, sans-serif";
            const space = pen.measureText(part.text).width;
            const left = first[0] + 9 + space > wide ? first[0] - 9 - space : first[0] + (part.beside || -4);
            pen.lineWidth = 3; pen.strokeText(part.text, left, first[1] + 4);
            pen.fillText(part.text, left, first[1] + 4);
          }
          if (part.tip) seen.push([first[0], first[1], part.tip]);
        }
      }
      pen.setLineDash([]); pen.fillStyle = tone("#52606d"); pen.font = "12px system-ui, sans-serif";
      pen.fillText(`grid: ${step >= 1000 ? `${step / 1000} m` : `${step} mm`}`, 8, high - 8);
    }

    // legend: a mark and a box to tick for each layer
    const entries = [...(scene.poses.length ? [{ label: "robot", colour: "#606e7c", kind: "robot" }] : []), ...scene.layers];
    const marks = [];
    for (const entry of entries) {
      const item = document.createElement("label"), tick = document.createElement("input"), mark = document.createElement("i");
      tick.type = "checkbox"; tick.checked = !entry.off;
      if (entry.off) { hidden.add(entry.label); item.classList.add("off"); }
      tick.addEventListener("change", () => { hidden[tick.checked ? "delete" : "add"](entry.label); item.classList.toggle("off", !tick.checked); draw(); });
      marks.push(() => { mark.style.color = tone(entry.colour || "#21918c"); });
      mark.style.borderTop = `3px ${entry.dash ? "dashed" : "solid"} currentColor`;
      if (entry.kind === "points" || entry.kind === "marker") { mark.className = entry.square || entry.kind === "marker" ? "square" : "round"; mark.style.background = entry.values ? "linear-gradient(90deg,#440154,#21918c,#fde725)" : "currentColor"; mark.style.border = "0"; }
      item.append(tick, mark, ` ${entry.label}`);
      label.append(item);
    }
    const bind = (name, act) => {
      const input = box.querySelector(`input[name=${name}]`), shown = box.querySelector(`output[name=${name}]`);
      if (!input) return;
      const change = () => { shown.textContent = act(Number(input.value)); draw(); };
      input.addEventListener("input", change);
      shown.textContent = act(Number(input.value));
    };
    bind("pose", (value) => { number = value; return scene.poses[value].name; });
    bind("scale", (value) => { scale = Number((10 ** value).toPrecision(value >= 1 ? 2 : 1)); return `× ${scale}`; });

    let held = null;
    canvas.addEventListener("pointerdown", (event) => { held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointerup", () => { held = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (held) {
        view.turn -= 0.008 * (event.clientX - held[0]);
        view.tilt = Math.min(Math.max(view.tilt + 0.008 * (event.clientY - held[1]), -1.55), 1.55);
        held = [event.clientX, event.clientY]; tip.hidden = true; draw();
        return;
      }
      const at = [event.offsetX, event.offsetY];
      const near = seen.reduce((best, one) => { const d = Math.hypot(one[0] - at[0], one[1] - at[1]); return d < best[0] ? [d, one] : best; }, [9, null])[1];
      tip.hidden = !near;
      if (near) { tip.textContent = near[2]; tip.style.left = `${Math.min(near[0] + 12, box.clientWidth - 220)}px`; tip.style.top = `${near[1] + 12}px`; }
    });
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return;  // else the page scrolls
      event.preventDefault(); view.zoom = Math.min(Math.max(view.zoom * Math.exp(-0.002 * event.deltaY), 0.3), 12); draw();
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [0.1, 0, 1], ArrowRight: [-0.1, 0, 1], ArrowUp: [0, 0.1, 1], ArrowDown: [0, -0.1, 1], "+": [0, 0, 1.2], "-": [0, 0, 1 / 1.2] }[event.key];
      if (!by) return;
      event.preventDefault(); view.turn += by[0]; view.tilt = Math.min(Math.max(view.tilt + by[1], -1.55), 1.55); view.zoom *= by[2]; draw();
    });
    box.picture = () => {
      draw();
      const [wide, high] = [canvas.width, canvas.height], pixels = canvas.toDataURL("image/png");
      return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${wide} ${high}" width="${wide / 2}" height="${high / 2}"><image width="${wide}" height="${high}" href="${pixels}"/></svg>`;
    };
    new ResizeObserver(draw).observe(box);
    const repaint = () => { for (const mark of marks) mark(); draw(); };
    night.addEventListener("change", repaint);
    for (const [event, is] of [["beforeprint", true], ["afterprint", false]]) window.addEventListener(event, () => { paper = is; repaint(); });
    repaint();
  }
  for (const holder of document.querySelectorAll("script[data-scene]")) drawScene(holder);
})();
