// The live panel: the solver of this page runs in it, beside RK4; what they conserve is drawn as it is computed.
if (document.getElementById("live-panel")) {
  const at = (id) => document.getElementById(`live-${id}`);
  const data = JSON.parse(at("data").textContent);
  const inputs = [...document.querySelectorAll("#live-panel input[type=range]")];
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const sides = ["ours", "theirs"];
  const swatches = [...document.querySelectorAll("#live-panel .swatch")];
  const view = freshView();
  const spaces = sides.map((side) => inSpace(at(side), view, draw, () => { Object.assign(view, freshView()); draw(); }));
  const made = {};
  const solverOf = (order) => (made[order] ??= liveSolvers[order]());
  const ahead = 100; // steps of the button, for those who ask for less motion
  let settings, standard, race, bounds, net, playing = false, waiting = 1, before = 0, seen = true;

  // -- settings, and the links that hold them

  const shortened = (value) => Number(value.toPrecision(4));
  const copy = (given) => ({ ...given, params: { ...given.params }, start: [...given.start] });

  // A value is looked up by the kind of its slider and a name.
  const get = (from, kind, name) => (kind === "params" ? from.params[name] : kind === "start" ? from.start[name] : from[kind]);
  function set(into, kind, name, value) {
    if (kind === "params") into.params[name] = value;
    else if (kind === "start") into.start[name] = value;
    else into[kind] = value;
  }

  // Sliders go from -100 to 100: over multiples of the usual value, or to both sides of it.
  function valueOf(input) {
    const { kind, name, reach } = input.dataset, place = Number(input.value) / 100, usual = get(standard, kind, name);
    if (kind === "order") return data.orders[Number(input.value)];
    if (place === 0) return usual;
    return shortened(input.dataset.scale === "log" ? usual * Number(reach) ** place : usual + Number(reach) * place);
  }

  function show(input) {
    const { kind, name, reach } = input.dataset, value = get(settings, kind, name), usual = get(standard, kind, name);
    const place = input.dataset.scale === "log" ? Math.log(value / usual) / Math.log(Number(reach)) : (value - usual) / Number(reach);
    input.value = kind === "order" ? data.orders.indexOf(value) : Math.round(100 * place);
    const told = String(value).length > 9 ? String(shortened(value)) : String(value);
    input.nextElementSibling.textContent = told.replace("-", "−");
    input.setAttribute("aria-valuetext", told);
  }

  function link() {
    const parts = new URLSearchParams({ h: settings.h, order: settings.order });
    const differs = (kind, name) => get(settings, kind, name) !== get(standard, kind, name);
    if (differs("speed")) parts.set("speed", settings.speed);
    if (differs("group")) parts.set("group", settings.group);
    for (const name of Object.keys(settings.params)) if (differs("params", name)) parts.set(`p.${name}`, settings.params[name]);
    data.coordinates.forEach((name, i) => { if (differs("start", i)) parts.set(`x.${name}`, settings.start[i]); });
    return `#live&${parts}`;
  }

  // The settings of an address; whatever is no number, or not allowed, is as usual.
  function linked() {
    const found = copy(standard), parts = new URLSearchParams(location.hash.replace(/^#live&?/, ""));
    const number = (key, allowed, take) => {
      const value = parts.has(key) ? Number(parts.get(key)) : NaN;
      if (Number.isFinite(value) && allowed(value)) take(value);
    };
    const positive = (v) => v > 0;
    number("h", (v) => v !== 0, (v) => { found.h = v; });
    number("speed", (v) => v > 0 && v <= 1e4, (v) => { found.speed = v; });
    number("order", (v) => data.orders.includes(v), (v) => { found.order = v; });
    number("group", (v) => v in data.groups, (v) => { found.group = v; });
    for (const { name, positive: only } of data.parameters) {
      number(`p.${name}`, only ? positive : () => true, (v) => { found.params[name] = v; });
    }
    data.coordinates.forEach((name, i) => number(`x.${name}`, () => true, (v) => { found.start[i] = v; }));
    return found;
  }

  // -- the motion

  const begin = (given) => new Race(solverOf(given.order), { ...given, t0: data.t0 }, data.quantities);

  // The first steps, no more than take so many milliseconds: where they lead, and the largest errors on the way.
  function tried(given, steps, milliseconds) {
    const trial = begin(given), { ours, theirs } = trial, end = performance.now() + milliseconds;
    const low = [...ours.x], high = [...ours.x];
    while (ours.steps < steps && !ours.failed && performance.now() < end) {
      trial.step();
      ours.x.forEach((v, i) => { low[i] = Math.min(low[i], v); high[i] = Math.max(high[i], v); });
    }
    const worst = (runner) => (runner.failed ? Infinity : Math.max(0, ...runner.histories.map(({ values }) => Math.max(...values))));
    return { trial, low, high, ours: worst(ours), theirs: worst(theirs) };
  }

  // How many steps are to be seen in a second: so many that the motion is neither a blur nor at rest.
  function pace(given) {
    const { trial, low, high } = tried(given, 60, 100), { axes } = data.groups[0];
    const chords = trial.ours.trail.slice(1).map(({ x }, k) => {
      return Math.hypot(...axes.map((a) => (x[a] - trial.ours.trail[k].x[a]) / (high[a] - low[a] || 1))) / Math.sqrt(axes.length);
    });
    const chord = chords.reduce((sum, c) => sum + c, 0) / Math.max(1, chords.length);
    return { longest: Math.max(...chords), speed: shortened(Math.max(15, Math.min(120, 3 / (chord || 1)))) };
  }

  // A step, and its speed, with which RK4 fails within some ten seconds, where there is one with which the solver
  // does not.
  function showing() {
    let best = { h: data.step, speed: pace(standard).speed, gain: 0 };
    const end = performance.now() + 800;
    for (let k = 0; data.quantities.length && k <= 7 && performance.now() < end; k++) {
      const given = { ...standard, h: shortened(data.step * 2 ** k) }, { longest, speed } = pace(given);
      const { ours, theirs } = tried(given, Math.min(400, 10 * speed), 200);
      if (ours > 0.03 || longest > 0.8) break;
      const gain = Math.min(theirs, 0.3) / Math.max(ours, 3e-3);
      if (gain > 1.2 * best.gain) best = { h: given.h, speed, gain };
      if (theirs > 0.2) break;
    }
    return best;
  }

  function restart() {
    waiting = 1;
    try {
      const { low, high } = tried(settings, 400, 60);
      race = begin(settings);
      lookAt(low, high);
      at("told").textContent = "";
    } catch (error) {
      if (!error.status) throw error;
      race = null;
      at("told").textContent = `No start: ${error.message}.`;
    }
    const address = link();
    at("link").href = address;
    inputs.forEach(show);
    draw();
    report();
  }

  // The box around the motion, and in it what the motion cannot leave: a surface, or a curve of one energy.
  function lookAt(low, high) {
    const { axes, leaf } = data.groups[settings.group], { solver, start } = race;
    const sizes = axes.map((a) => high[a] - low[a]), largest = Math.max(...sizes) || 1;
    const around = (part) => axes.map((a, k) => {
      const middle = (low[a] + high[a]) / 2, half = Math.max(0.53 * sizes[k], part * largest);
      return { name: data.coordinates[a], low: middle - half, high: middle + half };
    });
    bounds = around(0.1);
    net = [];
    if (leaf === null) return;
    const quantity = leaf < 0 ? (x) => solver.hamiltonian(x) : (x) => solver.casimirs(x)[leaf];
    const level = quantity(start), point = Float64Array.from(start);
    const off = (...values) => {
      values.forEach((v, k) => { point[axes[k]] = v; });
      return quantity(point) - level;
    };
    bounds = wholeIn(around(1), off) ?? bounds;
    net = drawnOn(off, bounds);
  }

  // The box of all points at which a function is zero, if that is within a box and does not reach its sides.
  function wholeIn(box, f) {
    const points = drawnOn(f, box).filter(Boolean);
    const inner = box.map((axis, k) => {
      const [least, most] = points.reduce(([a, b], p) => [Math.min(a, p[k]), Math.max(b, p[k])], [Infinity, -Infinity]);
      const [margin, rim] = [0.04 * (axis.high - axis.low), 0.06 * (most - least)];
      const inside = least > axis.low + margin && most < axis.high - margin;
      return inside && { ...axis, low: least - rim, high: most + rim };
    });
    return inner.every(Boolean) ? inner : null;
  }

  // Where a function of two or three coordinates is zero: points, and null where a line ends.
  function drawnOn(f, box) {
    const [u, v, w] = box.map(({ low, high }) => [low, high]), lines = [];
    if (!w) {
      for (const [a, b, c, d] of contour(f, u, v, 60)) lines.push([a, b], [c, d], null);
      return lines;
    }
    const cuts = [[u, v, w, (a, b, c) => [a, b, c]], [u, w, v, (a, b, c) => [a, c, b]], [v, w, u, (a, b, c) => [c, a, b]]];
    for (const [p, q, [low, high], order] of cuts) {
      for (let k = 1; k <= 7; k++) {
        const place = low + ((high - low) * k) / 8;
        for (const [a, b, c, d] of contour((s, t) => f(...order(s, t, place)), p, q, 26)) {
          lines.push(order(a, b, place), order(c, d, place), null);
        }
      }
    }
    return lines;
  }

  // -- what is seen

  const ink = () => getComputedStyle(at("panel")).color;
  const colour = (k) => getComputedStyle(swatches[k]).color;

  // A map from the axes of the box to a canvas.
  function plane(canvas) {
    const roomy = canvas.clientWidth > 260, left = roomy ? 44 : 16, below = roomy ? 30 : 16;
    const [u, v] = bounds, width = canvas.clientWidth - left - 10, height = canvas.clientHeight - below - 10;
    const place = ([a, b]) => [left + (width * (a - u.low)) / (u.high - u.low), 10 + (height * (v.high - b)) / (v.high - v.low), 0];
    return { roomy, left, below, width, height, place };
  }

  function drawPlane(canvas, pen, { roomy, left, width, height }) {
    const [u, v] = bounds, end = ({ low, high }, value) => rounded(value, Math.max(0, digitsBetween(low, high) - 2));
    pen.strokeStyle = pen.fillStyle = ink();
    pen.lineWidth = 0.7;
    pen.globalAlpha = 0.35;
    pen.strokeRect(left, 10, width, height);
    pen.globalAlpha = 1;
    const write = (text, x, y, align, baseline) => {
      [pen.textAlign, pen.textBaseline] = [align, baseline];
      pen.fillText(text, x, y);
    };
    pen.font = `italic ${roomy ? 14 : 11}px sans-serif`;
    write(u.name, left + width / 2, height + 13, "center", "top");
    write(v.name, left - 6, 10 + height / 2, "right", "middle");
    if (!roomy) return;
    pen.font = "12px sans-serif";
    write(end(u, u.low), left, height + 14, "left", "top");
    write(end(u, u.high), left + width, height + 14, "right", "top");
    write(end(v, v.low), left - 5, height + 10, "right", "bottom");
    write(end(v, v.high), left - 5, 10, "right", "top");
  }

  // The trail up to a part of the last step, as points on the screen.
  function trailOf(runner, axes, place) {
    const points = [], { trail } = runner, parts = 6;
    for (let k = 1; k < trail.length; k++) {
      const upTo = k === trail.length - 1 && !runner.failed ? waiting : 1;
      for (let s = 0; s < parts && s / parts < upTo; s++) {
        points.push(place(axes.map((a) => between(trail[k - 1], trail[k], s / parts, a))));
      }
      if (k === trail.length - 1) points.push(place(axes.map((a) => between(trail[k - 1], trail[k], upTo, a))));
    }
    return points.length ? points : [place(axes.map((a) => trail[0].x[a]))];
  }

  function drawSide(k) {
    const canvas = at(sides[k]), { pen, begin: clear, box, placed, curve } = spaces[k];
    clear();
    if (!race) return;
    const runner = race[sides[k]], { axes } = data.groups[settings.group];
    let place;
    if (axes.length === 3) {
      const { middle, half, reach } = framed(bounds);
      box(bounds.map((axis, i) => ({ ...axis, reach: reach[i] })), ink());
      place = (point) => placed(point.map((v, i) => (v - middle[i]) / half[i]));
    } else {
      const flat = plane(canvas);
      drawPlane(canvas, pen, flat);
      place = flat.place;
    }
    curve(net.map((p) => p && place(p)), getComputedStyle(canvas).color, axes.length === 3 ? 0.7 : 5, axes.length === 3 ? [0.15, 0.8] : [0.45, 0.45], true);
    const points = trailOf(runner, axes, place), parts = 6;
    pen.strokeStyle = pen.fillStyle = colour(k);
    pen.lineWidth = 1.7;
    for (let part = 0; part < parts; part++) {
      pen.globalAlpha = 0.12 + (0.88 * (part + 1)) / parts;
      pen.beginPath();
      const [first, last] = [part, part + 1].map((p) => Math.floor((p * (points.length - 1)) / parts));
      for (let i = first; i <= last; i++) pen.lineTo(points[i][0], points[i][1]);
      pen.stroke();
    }
    pen.globalAlpha = 1;
    const [x, y] = points.at(-1);
    pen.beginPath();
    pen.arc(x, y, 5, 0, 7);
    pen.fill();
  }

  const superscript = (n) => String(n).replace("-", "⁻").replace(/\d/g, (d) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[d]);

  // An error to read: in per cent, or as a power of ten where that would be many zeros.
  function readable(error) {
    if (!Number.isFinite(error)) return "∞";
    if (error > 10) return "over 1000 %";
    if (error >= 5e-4) return `${Number((100 * error).toPrecision(error < 0.1 ? 1 : 2))} %`;
    if (error === 0) return "0";
    const power = Math.floor(Math.log10(error));
    return `${Math.min(9, Math.round(error / 10 ** power))}·10${superscript(power)}`;
  }

  function drawScores(k) {
    const runner = race?.[sides[k]];
    [...at(`${sides[k]}-scores`).children].forEach((row, i) => {
      row.firstElementChild.textContent = !runner ? "–" : readable(runner.histories[i].last);
    });
    const told = runner?.failed ? `Broke down after ${runner.steps} steps.` : "";
    if (at(`${sides[k]}-told`).textContent !== told) at(`${sides[k]}-told`).textContent = told;
  }

  // Errors over the time, from 10^-17 to 10, one panel for each group of quantities.
  function drawErrors() {
    const canvas = at("errors"), pen = canvas.getContext("2d"), scale = window.devicePixelRatio || 1;
    canvas.width = canvas.clientWidth * scale;
    canvas.height = canvas.clientHeight * scale;
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    if (!race) return;
    const panels = race.groups.length, wide = canvas.clientWidth / panels, [left, top, below] = [40, 22, 22];
    const height = canvas.clientHeight - top - below;
    const y = (error) => top + height * (1 - (Math.log10(Math.min(10, Math.max(1e-17, error))) + 17) / 18);
    pen.font = "12px sans-serif";
    race.groups.forEach((group, g) => {
      const x0 = g * wide + left, width = wide - left - 12;
      pen.fillStyle = pen.strokeStyle = ink();
      [pen.textAlign, pen.textBaseline] = ["left", "top"];
      pen.fillText(`off ${group.name}`, x0, 2, width);
      [pen.textAlign, pen.textBaseline] = ["right", "middle"];
      for (const power of [-16, -12, -8, -4, 0]) {
        pen.fillText(power === 0 ? "1" : `10${superscript(power)}`, x0 - 5, y(10 ** power));
        pen.globalAlpha = 0.18;
        pen.fillRect(x0, y(10 ** power), width, 1);
        pen.globalAlpha = 1;
      }
      const steps = Math.max(race.ours.steps, race.theirs.steps, 20);
      [pen.textAlign, pen.textBaseline] = ["right", "top"];
      pen.fillText(`${steps} steps`, x0 + width, canvas.clientHeight - 16);
      sides.forEach((side, k) => {
        const { values, steps: until } = race[side].histories[g];
        pen.strokeStyle = colour(k);
        pen.lineWidth = 1.8;
        pen.setLineDash(k ? [6, 3] : []);
        pen.beginPath();
        values.forEach((v, i) => pen.lineTo(x0 + (width * until * (i + 1)) / values.length / steps, y(v)));
        pen.stroke();
      });
      pen.setLineDash([]);
    });
  }

  function draw() {
    sides.forEach((_, k) => drawSide(k));
    sides.forEach((_, k) => drawScores(k));
    if (at("errors")) drawErrors();
    at("order").textContent = `order ${settings.order}`;
    at("steps").textContent = race ? `${race.ours.steps} steps` : "";
  }

  // For screen readers, and for whoever examines the page: where both are when they rest.
  function report() {
    const { dataset } = at("panel");
    dataset.settings = JSON.stringify(settings);
    if (!race) return;
    for (const side of sides) dataset[side] = JSON.stringify({ steps: race[side].steps, t: race[side].t, x: [...race[side].x] });
  }

  function rest() {
    playing = false;
    at("play").textContent = still.matches ? `${ahead} steps` : "Play";
    waiting = 1;
    if (race?.ours.steps) {
      const told = (runner) => race.groups.map(({ name }, i) => `${name} by ${readable(runner.histories[i].last)}`).join(", ");
      at("told").textContent = `After ${race.ours.steps} steps, phigen is off ${told(race.ours)}; RK4 ${told(race.theirs)}.`;
      if (!race.groups.length) at("told").textContent = `After ${race.ours.steps} steps.`;
    }
    draw();
    report();
  }

  function frame(now) {
    if (!playing) return;
    const passed = Math.min(0.1, (now - before) / 1000), end = performance.now() + 14;
    before = now;
    if (race && seen && !document.hidden) {
      waiting += passed * settings.speed;
      while (waiting > 1 && performance.now() < end) {
        race.step();
        waiting -= 1;
      }
      waiting = Math.min(waiting, 1);
      draw();
    }
    requestAnimationFrame(frame);
  }

  function play() {
    if (still.matches) {
      for (let k = 0; race && k < ahead; k++) race.step();
      return rest();
    }
    playing = true;
    before = performance.now();
    at("play").textContent = "Pause";
    at("told").textContent = "";
    requestAnimationFrame(frame);
  }

  // -- controls

  at("play").addEventListener("click", () => (playing ? rest() : play()));
  at("step").addEventListener("click", () => {
    race?.step();
    rest();
  });
  at("reset").addEventListener("click", restart);
  at("usual").addEventListener("click", () => {
    settings = copy(standard);
    restart();
  });
  for (const input of inputs) {
    input.addEventListener("input", () => {
      set(settings, input.dataset.kind, input.dataset.name, valueOf(input));
      if (input.dataset.kind !== "speed") return restart();
      at("link").href = link();
      show(input);
    });
  }
  at("group")?.addEventListener("change", () => {
    settings.group = Number(at("group").value);
    restart();
  });
  function follow() {
    if (!location.hash.startsWith("#live&") || location.hash === link()) return;
    settings = linked();
    if (at("group")) at("group").value = settings.group;
    restart();
  }
  addEventListener("hashchange", follow);
  still.addEventListener("change", rest);
  document.documentElement.addEventListener("themechange", draw);
  new ResizeObserver(draw).observe(at("ours"));
  new IntersectionObserver((entries) => { seen = entries.at(-1).isIntersecting; }).observe(at("ours"));

  standard = { h: data.step, order: data.order, speed: 30, group: 0, params: {}, start: data.start };
  for (const { name, value } of data.parameters) standard.params[name] = value;
  at("panel").hidden = false;
  const { h, speed } = showing();
  Object.assign(standard, { h, speed });
  settings = copy(standard);
  follow();
  if (location.hash.startsWith("#live&")) at("panel").scrollIntoView();
  if (at("group")) at("group").value = settings.group;
  restart();
  if (still.matches) rest(); else play();
}
