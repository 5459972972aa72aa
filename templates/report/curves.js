// Pictures of the live panel for ordinary systems: the motion in space or in a plane, with the surface or
// curve on which a conserved quantity keeps the motion.

// The unit for errors of a quantity: its value at the start, or the magnitude of its terms if the value is
// nearly 0.
function unitOf(quantity, x) {
  const value = Math.abs(quantity(x));
  let terms = 0;
  x.forEach((v, i) => {
    const moved = [1e-6, -1e-6].map((part) => quantity(x.map((w, j) => (i === j ? w * (1 + part) : w))));
    const term = Math.abs(moved[0] - moved[1]) / 2e-6;
    if (Number.isFinite(term)) terms += term;
  });
  return value > 1e-3 * terms ? value : terms || 1;
}

// Coordinate i between the states a and b, at the fraction s of the step. The cubic polynomial has the
// values and slopes of both states.
function between(a, b, s, i) {
  const r = 1 - s;
  return r * r * (1 + 2 * s) * a.x[i] + r * r * s * a.slope[i] + s * s * (3 - 2 * s) * b.x[i] - s * s * r * b.slope[i];
}

// The lines f = 0 over a grid in a plane, as short segments [u, v, u, v] between two points. Sign changes of
// f at poles are left out.
function contour(f, [u0, u1], [v0, v1], count) {
  const u = (i) => u0 + ((u1 - u0) * i) / count, v = (j) => v0 + ((v1 - v0) * j) / count;
  const values = Array.from({ length: count + 1 }, (_, i) => Array.from({ length: count + 1 }, (_, j) => f(u(i), v(j))));
  const lines = [];
  for (let i = 0; i < count; i++) {
    for (let j = 0; j < count; j++) {
      const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
      const ends = [];
      corners.forEach(([a, b], k) => {
        const [c, d] = corners[(k + 1) % 4], [p, q] = [values[a][b], values[c][d]];
        if (!(p < 0 !== q < 0 && Number.isFinite(p) && Number.isFinite(q))) return;
        const s = p / (p - q), at = [u(a) + s * (u(c) - u(a)), v(b) + s * (v(d) - v(b))];
        if (Math.abs(f(...at)) <= Math.max(Math.abs(p), Math.abs(q))) ends.push(at);
      });
      for (let k = 0; k + 1 < ends.length; k += 2) lines.push([...ends[k], ...ends[k + 1]]);
    }
  }
  return lines;
}

function makeView(panel) {
  const { at, data, sides, ink, colour, tried, shortened } = panel;
  const view = freshView(), reset = () => { Object.assign(view, freshView()); panel.draw(); };
  const spaces = sides.map((side) => inSpace(at(side), view, () => panel.draw(), reset));
  let bounds, net;

  // Return a comparison (class Race) of a new solver with RK4. It measures the errors of conserved
  // quantities. If the solver refuses the settings, its error is thrown.
  function begin({ Solver, rateAt }, given) {
    const solver = new Solver({ x0: given.start, t0: data.t0, params: given.params });
    const field = (x, t) => {
      const rate = rateAt ? rateAt(solver.params, x) : 1;
      return { x: solver.vectorField(x, t).map((v) => v * rate), t: rate };
    };
    const start = Float64Array.from(given.start);
    const groups = data.quantities.map(({ name, casimirs, invariants }) => {
      const parts = casimirs ? casimirs.map((c) => (x) => solver.casimirs(x)[c])
        : invariants ? invariants.map((i) => (x, t) => liveInvariants[i](x, solver.params, t))
        : [(x) => solver.hamiltonian(x)];
      const values = parts.map((part) => part(start, data.t0));
      const units = parts.map((part) => unitOf((x) => part(x, data.t0), start));
      return { name, error: (x, t) => Math.max(...parts.map((part, k) => Math.abs(part(x, t) - values[k]) / units[k])) };
    });
    return new Race(solver, { h: given.h, parts: given.parts, field, groups, remember: (runner) => remember(runner, field, given.h) });
  }

  // Append the state of one method's run to its trail, with the derivative ẋ multiplied by the step size.
  function remember(runner, field, h) {
    const slope = field(runner.x, runner.t).x.map((v) => v * h);
    (runner.trail ??= []).push({ x: runner.x, slope });
    if (runner.trail.length > MOST) runner.trail.shift();
  }

  // Make a trial run of some steps. Return the comparison with RK4, and for each coordinate the least and the
  // largest value that the solver reached.
  function bounded(given, steps, milliseconds) {
    let low, high;
    const trial = tried(given, steps, milliseconds, ({ x }) => {
      low = low ? low.map((v, i) => Math.min(v, x[i])) : [...x];
      high = high ? high.map((v, i) => Math.max(v, x[i])) : [...x];
    });
    return { trial, low, high };
  }

  // Return a speed in steps per second at which the motion is easy to follow. Also return the largest
  // distance between successive states, and the length of the motion in a second, both relative to the size
  // of the picture.
  function pace(given) {
    const { trial, low, high } = bounded(given, 60, 100), { axes } = data.groups[0];
    const chords = trial.ours.trail.slice(1).map(({ x }, k) => {
      return Math.hypot(...axes.map((a) => (x[a] - trial.ours.trail[k].x[a]) / (high[a] - low[a] || 1))) / Math.sqrt(axes.length);
    });
    const chord = chords.reduce((sum, c) => sum + c, 0) / Math.max(1, chords.length);
    const speed = shortened(Math.max(15, Math.min(120, 3 / (chord || 1))));
    return { longest: Math.max(...chords), moved: chord * speed, speed };
  }

  // Compute the box around the motion. In this box, compute the surface or curve on which the motion stays:
  // the level set of a Casimir or of the energy.
  function look() {
    const { settings, race } = panel, { low, high } = bounded(settings, 400, 60);
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

  // Return the box around all zeros of a function in a larger box; null if the zeros reach the sides of the
  // larger box.
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

  // Return lines on which a function of two or three coordinates is zero: their points, with null after each
  // line.
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

  // The place of a plane picture on a canvas, with the map `place` from coordinates to the canvas.
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

  // Return the trail of one method's run as points on the screen. Of the last step, the trail contains
  // only the part that the animation has reached.
  function trailOf(runner, axes, place) {
    const points = [], { trail } = runner, { waiting } = panel, parts = 6;
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
    const { race, settings } = panel;
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

  const observed = ({ x, t, race: { solver } }) => (data.observed.length ? solver.observables(x, t) : []);

  return { begin, pace, look, rehearsed: (given) => given, drawSide, observed };
}
