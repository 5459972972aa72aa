// Pictures of the live panel for lattices: fields over space and time, in a plane or on a graph, or moving sites.

// Return a generator of random numbers from 0 to 1. Equal seeds give equal numbers.
function randomNumbers(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let mixed = Math.imul(state ^ (state >>> 15), state | 1);
    mixed ^= mixed + Math.imul(mixed ^ (mixed >>> 7), mixed | 61);
    return ((mixed ^ (mixed >>> 14)) >>> 0) / 2 ** 32;
  };
}

// Return the values of a field or parameter. `given` describes them as in a spec: by a number, a list, random
// values, or a formula that depends on the indices and the sizes.
function valuesOf(given, name, sizes, length) {
  if (given.number !== undefined) return new Float64Array(length).fill(given.number);
  if (given.listed) return Float64Array.from(given.listed);
  if (given.random) {
    const next = randomNumbers(given.seed + 1);
    const normal = () => Math.sqrt(-2 * Math.log(1 - next())) * Math.cos(2 * Math.PI * next());
    return Float64Array.from({ length }, () => given.scale * (given.random === "uniform" ? 2 * next() - 1 : normal()));
  }
  const places = (site) => sizes.map((size, a) => Math.floor(site / sizes.slice(a + 1).reduce((p, n) => p * n, 1)) % size);
  return Float64Array.from({ length }, (_, site) => liveValues[name](...places(site), ...sizes));
}

// Return the initial values of all fields: first those of the first field at all sites, then those of the
// next field, and so on.
function startOf(data, sizes, count) {
  const whole = data.initial[""], fields = data.coordinates.length;
  if (!whole) return Float64Array.from(data.coordinates.flatMap((name) => [...valuesOf(data.initial[name], name, sizes, count)]));
  if (whole.random !== "sphere") return valuesOf(whole, "", sizes, fields * count);
  const drawn = valuesOf({ ...whole, random: "normal", scale: 1 }, "", sizes, fields * count);
  const length = (site) => Math.hypot(...data.coordinates.map((_, f) => drawn[f * count + site]));
  return drawn.map((v, k) => (whole.scale * v) / length(k % count));
}

// Colours for values from 0 to 1. For values of both signs, LIGHT and DARK are used on light and on dark
// pages; their middle is the colour of the page.
const VIRIDIS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
const LIGHT = [[5, 70, 140], [94, 160, 205], [246, 247, 248], [235, 130, 90], [150, 12, 30]];
const DARK = [[130, 205, 255], [35, 110, 170], [28, 34, 41], [190, 85, 45], [255, 200, 150]];
function mixed(stops, part) {
  const place = Math.max(0, Math.min(1, part || 0)) * (stops.length - 1), k = Math.min(stops.length - 2, Math.floor(place));
  return stops[k].map((c, i) => c + (place - k) * (stops[k + 1][i] - c));
}

// The colour of a direction in space: the hue is the angle of (x, y), and z determines the lightness.
function directed(x, y, z) {
  const length = Math.hypot(x, y, z) || 1, angle = Math.atan2(y, x), light = 0.5 + (0.42 * z) / length;
  const depth = Math.min(light, 1 - light) * (Math.hypot(x, y) / length);
  return [0, 1, 2].map((k) => 255 * (light + depth * Math.cos(angle - (2 * Math.PI * k) / 3)));
}

const COLUMNS = 240; // a diagram with more columns than this loses every second one
const BEHIND = 60; // number of steps in the trails of moving sites

function makeView(panel) {
  const { at, data, sides, ink, colour, tried, shortened } = panel;
  const sizesOf = (given) => data.sizes[given.sites];
  const countOf = (sizes) => sizes.reduce((product, n) => product * n, 1);
  let low, high, table, ground;

  // Return a comparison (class Race) of a new solver with RK4. It measures the errors of conserved
  // quantities. If the solver refuses the settings, its error is thrown.
  function begin({ Solver }, given) {
    const sizes = sizesOf(given), count = countOf(sizes), params = { ...given.params };
    for (const [name, values] of Object.entries(data.arrays)) {
      params[name] = valuesOf(values, name, sizes, values.at === "bonds" ? data.bonds.length / 2 : count);
    }
    const solver = new Solver({ x0: startOf(data, sizes, count), t0: data.t0, sizes, params, bonds: data.bonds });
    const groups = data.quantities.map(({ name, casimirs, invariants }) => ({ name, error: invariants ? offInvariants(solver, invariants) : casimirs ? offCasimirs(solver, casimirs) : energyError(solver) }));
    const field = (x, t) => ({ x: solver.vectorField(x, t), t: 1 }), chosen = data.groups[given.group];
    return new Race(solver, { h: given.h, parts: given.parts, field, groups, remember: (runner) => remember(runner, solver, chosen, sizes) });
  }

  // Return a function that computes the energy error. The error is relative to |H| at the start. If |H| is
  // nearly 0, it is relative to the sum of the magnitudes of the energies of all sites.
  function energyError(solver) {
    const energy = solver.hamiltonian(), sites = solver.density().reduce((sum, v) => sum + Math.abs(v), 0);
    const unit = (Math.abs(energy) > 1e-3 * sites ? Math.abs(energy) : sites) || 1;
    return (x) => Math.abs(solver.hamiltonian(x) - energy) / unit;
  }

  // Return a function that computes the largest relative error of some Casimirs. For a Casimir of each
  // site, this is the error at the worst site, relative to the mean magnitude. For a sum over the sites,
  // the error is relative to the sum of the magnitudes; for a product, to the value at the start.
  function offCasimirs(solver, chosen) {
    const first = solver.casimirs(), { count } = solver.sites, kinds = solver.constructor.CASIMIR_KINDS;
    const units = kinds.map((_, k) => first.subarray(k * count, (k + 1) * count).reduce((sum, v) => sum + Math.abs(v), 0) || 1);
    return (x) => {
      const now = solver.casimirs(x);
      return Math.max(...chosen.map((k) => {
        let sum = 0, product = 1, most = 0;
        for (let i = k * count; i < (k + 1) * count; i++) {
          sum += now[i] - first[i];
          product *= now[i] / first[i];
          most = Math.max(most, Math.abs(now[i] - first[i]));
        }
        if (kinds[k] === "product") return Math.abs(product - 1);
        return (kinds[k] === "sum" ? Math.abs(sum) : most * count) / units[k];
      }));
    };
  }

  // Return a function that computes the largest error of some invariants. Each invariant is an observable of
  // the solver. The observable that follows it is the sum of the magnitudes of its terms.
  function offInvariants(solver, chosen) {
    const first = Float64Array.from(solver.observables());
    const unit = (k) => (Math.abs(first[k]) > 1e-3 * first[k + 1] ? Math.abs(first[k]) : first[k + 1]) || 1;
    const units = chosen.map(unit);
    return (x, t) => {
      const now = solver.observables(x, t);
      return Math.max(...chosen.map((k, i) => Math.abs(now[k] - first[k]) / units[i]));
    };
  }

  // -- stored values of states

  // Return the values to draw: those of the chosen field, of the three fields that form a direction, or the
  // positions of moving sites. If a lattice has three axes, only the plane in the middle of the first axis is
  // drawn.
  function shown({ x, t }, solver, { kind, fields }, sizes) {
    const count = countOf(sizes), plane = sizes.length > 2 ? sizes[1] * sizes[2] : count;
    const from = sizes.length > 2 ? plane * Math.floor(sizes[0] / 2) : 0;
    if (kind === "energy") return Float32Array.from(solver.density(x).subarray(from, from + plane));
    const kept = new Float32Array(fields.length * plane), values = kind === "observed" ? solver.observedFields(x, t) : x;
    fields.forEach((f, k) => kept.set(values.subarray(f * count + from, f * count + from + plane), k * plane));
    return kept;
  }

  // Store the values to draw. A diagram needs its columns, moving sites need their trails, and other pictures
  // need the last two states.
  function remember(runner, solver, chosen, sizes) {
    const kept = (runner.kept ??= { list: [], stride: 1, since: 0 });
    if (++kept.since < kept.stride) return;
    kept.since = 0;
    kept.list.push(shown(runner, solver, chosen, sizes));
    if (data.picture === "diagram" && kept.list.length > COLUMNS) {
      kept.list = kept.list.filter((_, k) => k % 2 === 0);
      kept.stride *= 2;
    }
    if (data.picture !== "diagram" && kept.list.length > (data.picture === "moving" ? BEHIND : 2)) kept.list.shift();
  }

  // -- choice of speed and colours

  // Make a trial run of some steps. Return the comparison with RK4, the least and the largest value to draw,
  // and the change of the values in each step, relative to their range.
  function surveyed(given, steps, milliseconds) {
    const chosen = data.groups[given.group], sizes = sizesOf(given), changes = [];
    let last, least = Infinity, most = -Infinity;
    const trial = tried(given, steps, milliseconds, (runner) => {
      const now = shown(runner, runner.race.solver, chosen, sizes);
      let sum = 0;
      now.forEach((v, k) => {
        if (!Number.isFinite(v)) return;
        [least, most] = [Math.min(least, v), Math.max(most, v)];
        if (last) sum += (v - last[k]) ** 2;
      });
      if (last) changes.push(Math.sqrt(sum / now.length));
      last = now;
    });
    return { trial, least, most, changes: changes.map((c) => c / (most - least || 1)) };
  }

  function pace(given) {
    const { changes } = surveyed(given, 40, 60), mean = changes.reduce((sum, c) => sum + c, 0) / (changes.length || 1);
    const speed = shortened(Math.max(25, Math.min(120, 1 / (mean || 1))));
    return { longest: data.picture === "moving" ? Math.max(...changes) : 0, moved: mean * speed, speed };
  }

  function look() {
    const { least, most } = surveyed(panel.settings, 300, 60), both = least < 0 && most > 0;
    [low, high] = both ? [-Math.max(-least, most), Math.max(-least, most)] : [least, most];
    if (!(high > low)) [low, high] = [low - 0.5, high + 0.5];
    if (data.picture === "moving") [low, high] = [least - 0.12 * (most - least), most + 0.12 * (most - least)];
    table = null;
  }

  // Extend the range of the colours if values of the solver are outside of it.
  function widen(values) {
    const reach = 0.1 * (high - low), both = low < 0 && high > 0;
    let least = low, most = high;
    for (const v of values) [least, most] = [Math.min(least, v), Math.max(most, v)];
    if (least > low - reach && most < high + reach) return;
    [low, high] = both ? [-Math.max(-least, most), Math.max(-least, most)] : [least, most];
    table = null;
  }

  // Return the settings for the search for the initial step. Planes and cubes get fewer sites: their motion
  // is similar, and the search is fast.
  function rehearsed(given) {
    const counts = data.sizes.map(countOf), few = counts.findLastIndex((count) => count <= 600);
    return data.picture === "plane" && few >= 0 ? { ...given, sites: Math.min(few, given.sites) } : given;
  }

  // -- pictures

  const isDark = (canvas) => Number(getComputedStyle(canvas).backgroundColor.match(/\d+/)?.[0] ?? 255) < 128;

  // The 256 colours for values from low to high.
  function colours(canvas) {
    const now = isDark(canvas);
    if (table && ground === now) return table;
    ground = now;
    const stops = low < 0 && high > 0 ? (now ? DARK : LIGHT) : VIRIDIS;
    table = Array.from({ length: 256 }, (_, k) => mixed(stops, k / 255));
    return table;
  }

  // Set the colours of pixels by the values of the sites. place(site) is the index of the pixel of a site.
  function paint(pixels, values, place, all, direction) {
    const count = direction ? values.length / 3 : values.length;
    for (let site = 0; site < count; site++) {
      const rgb = direction
        ? directed(values[site], values[site + count], values[site + 2 * count])
        : all[Math.max(0, Math.min(255, Math.round((255 * (values[site] - low)) / (high - low)) || 0))];
      const from = 4 * place(site);
      for (let c = 0; c < 3; c++) pixels[from + c] = rgb[c];
      pixels[from + 3] = 255;
    }
  }

  // Return the picture of the run of one method. The picture of a diagram is used again as long as colours
  // and stride are unchanged, so that only new columns are painted.
  function pictureOf(runner, width, height, all) {
    const { kept } = runner;
    const fresh = runner.picture?.all === all && runner.picture.stride === kept.stride && data.picture === "diagram";
    if (!fresh) {
      const canvas = document.createElement("canvas");
      Object.assign(canvas, { width, height });
      const pen = canvas.getContext("2d");
      runner.picture = { canvas, pen, image: pen.createImageData(width, height), painted: 0, all, stride: kept.stride };
    }
    return runner.picture;
  }

  // Clear the canvas of one method. Return the rectangle that remains for the picture beside the axis names
  // and the colour scale.
  function frame(k) {
    const canvas = at(sides[k]), pen = canvas.getContext("2d"), scale = window.devicePixelRatio || 1;
    canvas.width = canvas.clientWidth * scale;
    canvas.height = canvas.clientHeight * scale;
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    const roomy = canvas.clientWidth > 260, bar = data.picture !== "moving" && group().kind !== "direction";
    const left = roomy ? 40 : 18, right = !bar ? 10 : roomy ? 56 : 20, below = roomy ? 26 : 18;
    return { canvas, pen, roomy, bar, left, top: 10, width: canvas.clientWidth - left - right, height: canvas.clientHeight - below - 10 };
  }

  const group = () => data.groups[panel.settings.group];

  function write(pen, text, x, y, align, baseline) {
    [pen.textAlign, pen.textBaseline] = [align, baseline];
    pen.fillText(text, x, y);
  }

  // Write the names and ends of two axes {name, low, high} around a rectangle.
  function named({ pen, roomy }, [u, v], x, y, width, height) {
    pen.fillStyle = pen.strokeStyle = ink();
    pen.font = `italic ${roomy ? 14 : 11}px sans-serif`;
    write(pen, u.name, x + width / 2, y + height + 4, "center", "top");
    write(pen, v.name, x - 6, y + height / 2, "right", "middle");
    if (!roomy) return;
    pen.font = "12px sans-serif";
    write(pen, u.low, x, y + height + 5, "left", "top");
    write(pen, u.high, x + width, y + height + 5, "right", "top");
    write(pen, v.low, x - 5, y + height, "right", "bottom");
    write(pen, v.high, x - 5, y, "right", "top");
  }

  // Draw the scale of colours, from low to high.
  function scaleOf({ canvas, pen, roomy, bar, top, height }, all) {
    if (!bar) return;
    const x = canvas.clientWidth - (roomy ? 48 : 14);
    for (let k = 0; k < height; k++) {
      pen.fillStyle = `rgb(${all[Math.round((255 * k) / height)].map(Math.round).join()})`;
      pen.fillRect(x, top + height - k - 1, 8, 1.5);
    }
    if (!roomy) return;
    const digits = Math.max(0, digitsBetween(low, high) - 2);
    pen.fillStyle = ink();
    pen.font = "12px sans-serif";
    write(pen, rounded(high, digits), x + 11, top, "left", "top");
    write(pen, rounded(low, digits), x + 11, top + height, "left", "bottom");
  }

  // Draw a chain over time: sites upwards, time to the right.
  function drawDiagram(space, runner) {
    const { canvas, pen, left, top, width, height } = space, all = colours(canvas), { list, stride } = runner.kept;
    const [count] = sizesOf(panel.settings), direction = group().kind === "direction";
    const picture = pictureOf(runner, COLUMNS + 1, count, all), { image } = picture;
    for (; picture.painted < list.length; picture.painted++) {
      paint(image.data, list[picture.painted], (site) => (count - 1 - site) * image.width + picture.painted, all, direction);
    }
    picture.pen.putImageData(image, 0, 0);
    pen.imageSmoothingEnabled = false;
    const longest = Math.max(...sides.map((side) => runner.race[side].kept.stride));
    pen.drawImage(picture.canvas, 0, 0, COLUMNS, count, left, top, (width * stride) / longest, height);
    const end = String(shortened(COLUMNS * longest * runner.race.h)), site = data.axes[0] ?? "site";
    named(space, [{ name: "t", low: "0", high: end }, { name: site, low: "0", high: String(count - 1) }], left, top, width, height);
    scaleOf(space, all);
  }

  // Draw a plane of sites as squares: the first axis to the right, the second upwards.
  function drawPlane(space, runner) {
    const { canvas, pen, left, top, width, height } = space, all = colours(canvas), sizes = sizesOf(panel.settings).slice(-2);
    const [across, upwards] = sizes, picture = pictureOf(runner, across, upwards, all), { image } = picture;
    const place = (site) => (upwards - 1 - (site % upwards)) * across + Math.floor(site / upwards);
    paint(image.data, runner.kept.list.at(-1), place, all, group().kind === "direction");
    picture.pen.putImageData(image, 0, 0);
    const unit = Math.min(width / across, height / upwards), x = left + (width - unit * across) / 2;
    pen.imageSmoothingEnabled = false;
    pen.drawImage(picture.canvas, x, top, unit * across, unit * upwards);
    const axes = data.axes.slice(-2).map((name, k) => ({ name, low: "0", high: String(sizes[k] - 1) }));
    named(space, axes, x, top, unit * across, unit * upwards);
    scaleOf(space, all);
  }

  // Draw moving sites with their trails. Sites at which the parameter data.sign is negative are drawn as
  // rings.
  function drawMoving(space, runner, k) {
    const { pen, left, top, width, height } = space, { list } = runner.kept, count = list[0].length / 2;
    const side = Math.min(width, height), x0 = left + (width - side) / 2, unit = side / (high - low);
    const place = (values, site) => [x0 + unit * (values[site] - low), top + side - unit * (values[site + count] - low)];
    const last = list.at(-1), before = list.at(-2) ?? last, part = runner.failed ? 1 : panel.waiting;
    const now = last.map((v, i) => before[i] + part * (v - before[i])), path = [...list.slice(0, -1), now];
    pen.save();
    pen.beginPath();
    pen.rect(x0, top, side, side);
    pen.clip();
    pen.strokeStyle = pen.fillStyle = colour(k);
    pen.lineWidth = 1.2;
    for (let piece = 0; piece < 4; piece++) {
      pen.globalAlpha = 0.1 + 0.2 * piece;
      pen.beginPath();
      const [from, to] = [piece, piece + 1].map((p) => Math.floor((p * (path.length - 1)) / 4));
      for (let site = 0; site < count; site++) {
        for (let i = from; i <= to; i++) pen[i === from ? "moveTo" : "lineTo"](...place(path[i], site));
      }
      pen.stroke();
    }
    pen.globalAlpha = 1;
    for (let site = 0; site < count; site++) {
      pen.beginPath();
      pen.arc(...place(now, site), 4, 0, 7);
      const sign = data.sign && runner.race.solver.params[data.sign][site] < 0;
      if (sign) pen.stroke(); else pen.fill();
    }
    data.names.forEach((name, site) => label(pen, name, ...place(now, site)));
    pen.restore();
    pen.strokeStyle = ink();
    pen.globalAlpha = 0.35;
    pen.lineWidth = 0.7;
    pen.strokeRect(x0, top, side, side);
    pen.globalAlpha = 1;
    const digits = Math.max(0, digitsBetween(low, high) - 2), ends = { low: rounded(low, digits), high: rounded(high, digits) };
    named(space, group().fields.map((f) => ({ name: data.coordinates[f], ...ends })), x0, top, side, side);
  }

  // Draw the sites of a graph with their bonds. The more sites there are, the smaller they are drawn.
  function drawGraph(space, runner) {
    const { canvas, pen, left, top, width, height } = space, all = colours(canvas), values = runner.kept.list.at(-1);
    const count = data.places.length / 2, direction = group().kind === "direction", pixels = new Float64Array(4 * count);
    paint(pixels, values, (site) => site, all, direction);
    const radius = Math.max(1.5, Math.min(9, (0.3 * Math.min(width, height)) / Math.sqrt(count)));
    const unit = Math.min(width, height) - 2 * radius, x0 = left + (width - unit) / 2, y0 = top + height - radius;
    const place = (site) => [x0 + unit * data.places[2 * site], y0 - unit * data.places[2 * site + 1]];
    pen.strokeStyle = ink();
    pen.globalAlpha = 0.3;
    pen.lineWidth = 0.7;
    pen.beginPath();
    for (let k = 0; k < data.bonds.length; k += 2) {
      pen.moveTo(...place(data.bonds[k]));
      pen.lineTo(...place(data.bonds[k + 1]));
    }
    pen.stroke();
    pen.globalAlpha = 1;
    for (let site = 0; site < count; site++) {
      pen.fillStyle = `rgb(${[0, 1, 2].map((c) => Math.round(pixels[4 * site + c])).join()})`;
      pen.beginPath();
      pen.arc(...place(site), radius, 0, 7);
      pen.fill();
      pen.stroke();
    }
    data.names.forEach((name, site) => label(pen, name, ...place(site)));
    scaleOf(space, all);
  }

  // Write the name of a site next to it.
  function label(pen, name, x, y) {
    pen.fillStyle = ink();
    pen.font = "12px sans-serif";
    write(pen, name, x + 7, y - 3, "left", "bottom");
  }

  const draws = { diagram: drawDiagram, plane: drawPlane, graph: drawGraph, moving: drawMoving };

  function drawSide(k) {
    const space = frame(k), runner = panel.race?.[sides[k]];
    if (runner && k === 0 && space.bar) widen(runner.kept.list.at(-1));
    if (runner) draws[data.picture](space, runner, k);
  }

  const observed = ({ x, t, race: { solver } }) => (data.observed.length ? solver.observables(x, t) : []);

  return { begin, pace, look, rehearsed, drawSide, observed };
}
