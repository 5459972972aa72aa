// Where the live panel begins: the order, the step and the speed with which the methods are seen to differ.
const SHOWN = 10; // seconds of the motion after which the methods are compared
const TRIED = 1200; // largest number of steps of a trial
const MILLISECONDS = { ours: 200, all: 2400 }; // largest durations of a trial, and of all trials
const VISIBLE = 3e-3, FAR = 0.3; // errors below are not seen in the picture, and all above look alike
const MARGIN = 0.03; // largest error of the solver with which the panel begins
const CHORD = 0.8; // longest part of the picture that a step may cross
const MOVED = 0.1; // least part of the picture that is crossed in a second, if a step allows it
const DOUBLED = 14; // how often the step of the run is doubled
const BETTER = 1.2, CLEAR = 4; // by this factor another setting must be better; with this score none is looked for

function makeStart({ data, begin, view, shortened, milliseconds = MILLISECONDS, costOf = (race) => equalWork(race, 1) }) {
  // How many steps RK4 takes for one of the solver: one, or as many as take as long here. Measured once for each order
  // and size and for steps of about one length, so that it does not change while a slider moves.
  const measured = {};
  const alike = ({ order, sites, h }) => [order, sites, Math.round(2 * Math.log2(Math.abs(h)))].join();
  const partsOf = (given) => (given.compare === "step" ? 1 : (measured[alike(given)] ??= costOf(begin({ ...given, parts: 1 }))));
  const remember = (given, parts) => { measured[alike(given)] = parts; };

  // The first steps, no more than a limit of milliseconds allows, each of ours watched.
  function tried(given, steps, limit, watch = () => {}) {
    const trial = begin(given), { ours } = trial, end = performance.now() + limit;
    watch(ours);
    while (ours.steps < steps && !ours.failed && performance.now() < end) {
      trial.step();
      watch(ours);
    }
    return trial;
  }

  const worst = ({ failed, histories }) => (failed ? Infinity : Math.max(0, ...histories.map((history) => Math.max(...halves(history)))));

  // Whether the solver has margin with a step: it does not break down with twice that.
  const hasMargin = (given) => worst(tried({ ...given, h: 2 * given.h }, 100, 60).ours) < 0.5;

  // How well the solver is seen to be better: the share of the groups in which RK4 is not closer, and by what factor the
  // errors of RK4 are larger, as far as these are seen in the picture; less with larger errors where RK4 is closer.
  function advantage(race) {
    const [ours, theirs] = [worst(race.ours), worst(race.theirs)], closer = groupsOfRk4(race).length;
    const seen = theirs > ours ? Math.min(theirs, FAR) / Math.max(ours, VISIBLE) : -Math.min(1, ours / MARGIN) / 2;
    return 1 - closer / race.groups.length + seen;
  }

  // The steps of an order with which the solver has margin and small errors, from that of the run to the first with
  // which RK4 fails at once; at least one.
  function stepsOf(given, end) {
    let h = data.step;
    const at = (step) => ({ ...given, h: step }), steps = [];
    for (let k = 0; k < 5 && !hasMargin(at(h)); k++) h = shortened(h / 2);
    for (let k = 0; k < DOUBLED && (k === 0 || performance.now() < end); k++) {
      const next = at(shortened(h * 2 ** k)), { longest, moved, speed } = view.pace(next);
      const { ours, theirs } = tried(next, 100, 60);
      if (k > 0 && (longest > CHORD || worst(ours) > MARGIN || !hasMargin(next))) break;
      if (moved < MOVED) steps.length = 0;
      steps.push({ order: given.order, h: next.h, speed });
      if (worst(theirs) > FAR) break;
    }
    return steps;
  }

  // The setting of an order in which the solver is seen to be better: of large steps, because there RK4 fails.
  function settingOf(given, end) {
    const [first, ...larger] = stepsOf(given, end);
    let best = { ...first, score: 0 };
    for (const setting of [...larger.reverse(), first]) {
      const next = { ...given, ...setting };
      const race = tried({ ...next, parts: partsOf(next) }, Math.min(TRIED, SHOWN * setting.speed), milliseconds.ours);
      const score = worst(race.ours) > MARGIN && setting !== first ? 0 : advantage(race);
      if (score > BETTER * best.score) best = { ...setting, score };
      if (best.score > CLEAR || performance.now() > end) break;
    }
    return best;
  }

  // The order, step and speed to begin with: of the order of the page, or of another where the advantage is not clear.
  function showing(standard) {
    const given = view.rehearsed({ ...standard, parts: 1 }), begun = performance.now();
    if (!data.quantities.length) return { order: data.order, h: data.step, speed: view.pace(given).speed };
    const others = data.orders.filter((order) => order !== data.order);
    let best = { score: 0 };
    for (const [k, order] of [data.order, ...others].entries()) {
      const setting = settingOf({ ...given, order }, begun + ((k + 1) * milliseconds.all) / (others.length + 1));
      if (setting.score > BETTER * best.score || k === 0) best = setting;
      if (best.score > CLEAR) break;
    }
    return best;
  }

  return { partsOf, remember, tried, showing };
}
