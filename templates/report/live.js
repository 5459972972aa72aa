// The live panel: the solver of this page and RK4 run side by side, and the errors of conserved quantities
// are shown.
if (document.getElementById("live-panel")) {
  const at = (id) => document.getElementById(`live-${id}`);
  const data = JSON.parse(at("data").textContent);
  const inputs = [...document.querySelectorAll("#live-panel input[type=range]")];
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const sides = ["ours", "theirs"];
  const swatches = [...document.querySelectorAll("#live-panel .swatch")];
  const made = {};
  const solverOf = (order) => (made[order] ??= liveSolvers[order]());
  const ahead = 100; // number of steps for each click, if the reader's system requests reduced motion
  // The lists from which some sliders select a value.
  const lists = { order: data.orders, sites: (data.sizes ?? []).map((_, k) => k) };
  let settings, standard, race, changed = false, playing = false, waiting = 1, before = 0, seen = true;

  // -- settings, and links that contain them

  const shortened = (value) => Number(value.toPrecision(4));
  const copy = (given) => ({ ...given, params: { ...given.params }, start: [...given.start] });

  // The setting that a slider with this kind and name changes.
  const get = (from, kind, name) => (kind === "params" ? from.params[name] : kind === "start" ? from.start[name] : from[kind]);
  function set(into, kind, name, value) {
    if (kind === "params") into.params[name] = value;
    else if (kind === "start") into.start[name] = value;
    else into[kind] = value;
  }

  // The value that a slider sets. The position of a slider, from -100 to 100, is divided by 100. On the
  // scale "log", the result is the exponent of the factor `reach`. Otherwise `reach` times the result is
  // added to the usual value.
  function valueOf(input) {
    const { kind, name, reach } = input.dataset, place = Number(input.value) / 100, usual = get(standard, kind, name);
    if (lists[kind]) return lists[kind][Number(input.value)];
    if (place === 0) return usual;
    return shortened(input.dataset.scale === "log" ? usual * Number(reach) ** place : usual + Number(reach) * place);
  }

  const superscript = (n) => String(n).replace("-", "⁻").replace(/\d/g, (d) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[d]);

  const counted = (steps) => (steps === 1 ? "1 step" : `${steps} steps`);

  // Sizes as text, such as 16 × 12 or 16³.
  const sized = (sizes) => sizes.length > 1 && new Set(sizes).size === 1 ? `${sizes[0]}${superscript(sizes.length)}` : sizes.join(" × ");

  function show(input) {
    const { kind, name, reach } = input.dataset, value = get(settings, kind, name), usual = get(standard, kind, name);
    const place = input.dataset.scale === "log" ? Math.log(value / usual) / Math.log(Number(reach)) : (value - usual) / Number(reach);
    input.value = lists[kind] ? lists[kind].indexOf(value) : Math.round(100 * place);
    const written = String(value).length > 9 ? String(shortened(value)) : String(value);
    const told = kind === "sites" ? sized(data.sizes[value]) : written;
    input.nextElementSibling.textContent = told.replace("-", "−");
    input.setAttribute("aria-valuetext", told);
  }

  function link() {
    const parts = new URLSearchParams({ h: settings.h, order: settings.order });
    const differs = (kind, name) => get(settings, kind, name) !== get(standard, kind, name);
    if (differs("speed")) parts.set("speed", settings.speed);
    if (differs("group")) parts.set("group", settings.group);
    if (settings.compare === "work") parts.set("rk4", settings.parts);
    if (differs("compare")) parts.set("compare", settings.compare);
    if (differs("sites")) parts.set("sites", settings.sites);
    for (const name of Object.keys(settings.params)) if (differs("params", name)) parts.set(`p.${name}`, settings.params[name]);
    settings.start.forEach((value, i) => { if (differs("start", i)) parts.set(`x.${data.coordinates[i]}`, value); });
    return `#live&${parts}`;
  }

  // Update the link to the settings and, after a setting was changed, the address of the page.
  function linkHere() {
    at("link").href = link();
    if (!changed) return;
    at("unused").hidden = true;
    try {
      history.replaceState(null, "", link());
    } catch { /* pages without an origin must not change the address */ }
  }

  // The settings in the address, and the parts of the address that are unknown or not allowed.
  function linked() {
    const found = copy(standard), parts = new URLSearchParams(location.hash.replace(/^#live&?/, ""));
    const unknown = new Set(parts.keys()), refused = [];
    const text = (key, allowed, take) => {
      if (!unknown.delete(key)) return;
      const value = parts.get(key);
      if (allowed(value)) take(value); else refused.push(`${key}=${value}`);
    };
    const number = (key, allowed, take) => {
      text(key, (v) => v.trim() !== "" && Number.isFinite(Number(v)) && allowed(Number(v)), (v) => take(Number(v)));
    };
    const positive = (v) => v > 0;
    text("compare", (v) => ["step", "work"].includes(v), (v) => { found.compare = v; });
    number("h", (v) => v !== 0, (v) => { found.h = v; });
    number("speed", (v) => v > 0 && v <= 1e4, (v) => { found.speed = v; });
    number("order", (v) => data.orders.includes(v), (v) => { found.order = v; });
    number("group", (v) => v in data.groups, (v) => { found.group = v; });
    number("sites", (v) => lists.sites.includes(v), (v) => { found.sites = v; });
    for (const { name, positive: only, nonnegative } of data.parameters) {
      const allowed = only ? positive : nonnegative ? (v) => v >= 0 : () => true;
      number(`p.${name}`, allowed, (v) => { found.params[name] = v; });
    }
    // A link contains the number of steps of RK4 for each step of the solver. So a reader who opens the
    // link sees the same comparison.
    number("rk4", (v) => v >= 1 && v <= MOST_PARTS && Number.isInteger(v), (v) => { start.remember(found, v); });
    found.start.forEach((_, i) => number(`x.${data.coordinates[i]}`, () => true, (v) => { found.start[i] = v; }));
    return { found, refused: [...refused, ...[...unknown].map((key) => `${key}=${parts.get(key)}`)] };
  }

  const clipped = (text) => (text.length > 200 ? `${text.slice(0, 200)}…` : text);

  // -- the motion

  const begin = (given) => view.begin(solverOf(given.order), given);

  function restart() {
    waiting = 1;
    try {
      settings.parts = start.partsOf(settings);
      race = begin(settings);
      view.look();
      at("told").textContent = "";
    } catch (error) {
      if (!error.status) throw error;
      race = null;
      at("told").textContent = `Cannot start: ${error.message}.`;
    }
    linkHere();
    inputs.forEach(show);
    at("compare").value = settings.compare;
    at("cost").textContent = settings.compare === "step" ? "one step for each step of phigen"
      : settings.parts === 1 ? "one step for each step of phigen: equal work in this browser"
      : `${settings.parts} steps for each step of phigen: equal work in this browser`;
    draw();
    report();
  }

  // -- display

  const ink = () => getComputedStyle(at("panel")).color;
  const colour = (k) => getComputedStyle(swatches[k]).color;

  // The pictures: curves.js draws them for ordinary systems, and fields.js for lattices.
  const view = makeView({
    at, data, sides, ink, colour, begin, shortened, draw, solverOf, restart,
    tried: (...given) => start.tried(...given),
    get settings() { return settings; },
    get standard() { return standard; },
    get race() { return race; },
    get waiting() { return waiting; },
  });
  const start = makeStart({ data, begin, view, shortened });

  // An error as text: in per cent, or with a power of ten if it is small.
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
    const observed = runner && !runner.failed ? view.observed(runner) : [];
    [...(at(`${sides[k]}-observed`)?.children ?? [])].forEach((row, i) => {
      row.lastElementChild.textContent = i in observed ? String(shortened(observed[i])).replace("-", "−") : "–";
    });
    const told = runner?.failed ? `Failed after ${counted(runner.steps)}: ${runner.failed}.` : "";
    if (at(`${sides[k]}-told`).textContent !== told) at(`${sides[k]}-told`).textContent = told;
  }

  // Draw the errors over time, from 10^-17 to 10, in one panel for each group of quantities.
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
      pen.fillText(group.name, x0, 2, width);
      [pen.textAlign, pen.textBaseline] = ["right", "middle"];
      for (const power of [-16, -12, -8, -4, 0]) {
        pen.fillText(power === 0 ? "1" : `10${superscript(power)}`, x0 - 5, y(10 ** power));
        pen.globalAlpha = 0.18;
        pen.fillRect(x0, y(10 ** power), width, 1);
        pen.globalAlpha = 1;
      }
      const steps = Math.max(race.ours.steps, race.theirs.steps, 20);
      [pen.textAlign, pen.textBaseline] = ["right", "top"];
      pen.fillText(counted(steps), x0 + width, canvas.clientHeight - 16);
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
    sides.forEach((_, k) => view.drawSide(k));
    sides.forEach((_, k) => drawScores(k));
    if (at("errors")) drawErrors();
    at("order").textContent = `order ${settings.order}`;
    at("steps").textContent = race ? counted(race.ours.steps) : "";
  }

  // Write settings and states to the attributes of the panel, where tests and scripts can read them.
  function report() {
    const { dataset } = at("panel");
    dataset.settings = JSON.stringify(settings);
    if (!race) return;
    for (const side of sides) {
      const { steps, t, x, histories } = race[side];
      dataset[side] = JSON.stringify({ steps, t, x: [...x], errors: histories.map(({ last }) => last), observed: [...view.observed(race[side])].slice(0, data.observed.length) });
    }
  }

  function rest() {
    playing = false;
    at("play").textContent = still.matches ? `${ahead} steps` : "Play";
    waiting = 1;
    if (race?.ours.steps) {
      const told = (runner) => race.groups.map(({ name }, i) => `${name} ${readable(runner.histories[i].last)}`).join(", ");
      at("told").textContent = `After ${counted(race.ours.steps)}: phigen, ${told(race.ours)}; RK4, ${told(race.theirs)}.`;
      if (!race.groups.length) at("told").textContent = `After ${counted(race.ours.steps)}.`;
      else at("told").textContent += ` ${whereRk4IsCloser(race)}`.trimEnd();
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
    changed = true;
    restart();
  });
  for (const input of inputs) {
    input.addEventListener("input", () => {
      set(settings, input.dataset.kind, input.dataset.name, valueOf(input));
      changed = true;
      if (input.dataset.kind !== "speed") return restart();
      linkHere();
      show(input);
    });
  }
  at("group")?.addEventListener("change", () => {
    settings.group = Number(at("group").value);
    changed = true;
    restart();
  });
  at("compare").addEventListener("change", () => {
    settings.compare = at("compare").value;
    changed = true;
    restart();
  });
  function follow() {
    if (!location.hash.startsWith("#live&") || location.hash === link()) return;
    const { found, refused } = linked();
    settings = found;
    if (at("group")) at("group").value = settings.group;
    restart();
    at("unused").hidden = !refused.length;
    at("unused").textContent = `Parts of the address that are unknown or not allowed, and were ignored: ${clipped(refused.join(", "))}`;
  }
  addEventListener("hashchange", follow);
  still.addEventListener("change", rest);
  document.documentElement.addEventListener("themechange", draw);
  new ResizeObserver(draw).observe(at("ours"));
  new IntersectionObserver((entries) => { seen = entries.at(-1).isIntersecting; }).observe(at("ours"));

  standard = { h: data.step, order: data.order, speed: 30, group: 0, compare: "work", parts: 1, params: {}, start: data.start, sites: data.site };
  for (const { name, value } of data.parameters) standard.params[name] = value;
  at("panel").hidden = false;
  const { order, h, speed } = start.showing(standard);
  Object.assign(standard, { order, h, speed });
  settings = copy(standard);
  follow();
  if (location.hash.startsWith("#live&")) at("panel").scrollIntoView();
  if (at("group")) at("group").value = settings.group;
  restart();
  if (still.matches) rest(); else play();
}
