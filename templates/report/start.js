// The settings with which the live panel starts: the order, the step and the speed at which the difference
// between the two methods is visible.
const SHOWN = 10; // seconds of motion after which the methods are compared
const TRIED = 1200; // largest number of steps in a trial run
const MILLISECONDS = { ours: 200, all: 2400 }; // longest time for one trial run, and for all of them
const VISIBLE = 3e-3, FAR = 0.3; // errors below VISIBLE cannot be seen; errors above FAR all look alike
const MARGIN = 0.03; // largest error of phigen's solver with the initial settings
const CHORD = 0.8; // largest distance between successive states, relative to the size of the picture
const MOVED = 0.1; // least length of the motion in a second, relative to the picture, if possible
const DOUBLED = 14; // largest number of step sizes to try; each is twice the previous one
const BETTER = 1.2, CLEAR = 4; // a better score is larger by the factor BETTER; the search ends above CLEAR

function makeStart({ data, begin, view, shortened, milliseconds = MILLISECONDS, costOf = (race) => equalWork(race, 1) }) {
  // The number of steps of RK4 for each step of the solver: one, or the number that takes as long in this
  // browser. Times are measured once for each order and size and for similar steps, so that the number
  // does not change while a slider moves.
  const measured = {};
  const alike = ({ order, sites, h }) => [order, sites, Math.round(2 * Math.log2(Math.abs(h)))].join();
  const partsOf = (given) => (given.compare === "step" ? 1 : (measured[alike(given)] ??= costOf(begin({ ...given, parts: 1 }))));
  const remember = (given, parts) => { measured[alike(given)] = parts; };

  // The comparison with RK4 after `steps` steps, or earlier if it takes longer than `limit` milliseconds.
  // watch(runner) is called for each state of phigen's solver.
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

  // Whether the errors of the solver are still small with twice the step.
  const hasMargin = (given) => worst(tried({ ...given, h: 2 * given.h }, 100, 60).ours) < 0.5;

  // A score for the visible advantage of the solver over RK4. One term is the share of those groups of
  // quantities in which RK4 does not have smaller errors. The other term is the largest error of RK4
  // divided by that of the solver, where only visible differences count. This term is negative if the
  // largest error of RK4 is smaller.
  function advantage(race) {
    const [ours, theirs] = [worst(race.ours), worst(race.theirs)], closer = groupsOfRk4(race).length;
    const seen = theirs > ours ? Math.min(theirs, FAR) / Math.max(ours, VISIBLE) : -Math.min(1, ours / MARGIN) / 2;
    return 1 - closer / race.groups.length + seen;
  }

  // Settings of one order with which the errors of the solver are small, even with twice the step. The
  // first step is that of the run, or a fraction of it if necessary. Each further step is twice the
  // previous one. Smaller steps are left out while the motion is slow. The list ends after the first
  // setting with which RK4 fails, or before the solver becomes inaccurate, or before the motion is too
  // fast to follow. The list has at least one setting.
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

  // The setting of one order that has the highest score. Large steps are tried first, since RK4 fails with
  // large steps.
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

  // The initial order, step and speed. Other orders are tried if the order of the page shows no clear
  // advantage.
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
