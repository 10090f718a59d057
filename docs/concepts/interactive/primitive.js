// A movement primitive to play with: the reader drags the goal and the weights, or draws a movement of their own.
// Both matrices stand in the page: encode, from a path to weights, and decode, from weights to a path.
(() => {
  const K = 1; // the matrices take and give weights over the stiffness, in millimeters

  /** Of each of d dimensions, the path from weights, start, goal and initial velocity. */
  function decode(data, name, one, goal) {
    const { Phi, velocity } = data;
    const pull = data.formulations[name].goal;
    return one.start.map((start, k) => {
      const ratio = ratioOf(name, one, goal, k);
      return Phi.map((row, t) => {
        const bent = row.reduce((sum, phi, i) => sum + phi * one.weights[k][i], 0);
        return start + ratio * bent + pull[t] * (goal[k] - start) + velocity[t] * one.velocity[k];
      });
    });
  }

  /** What the forcing term is multiplied by when the goal is another than the one that was shown. */
  function ratioOf(name, one, goal, k) {
    const shown = one.goal[k] - one.start[k];
    return name === "original" && Math.abs(shown) > 1e-9 ? (goal[k] - one.start[k]) / shown : 1;
  }

  /** Weights and initial velocity of a path, d rows of T even samples. */
  function encode(data, name, path) {
    const rows = data.formulations[name].encode;
    const start = path.map((row) => row[0]);
    const fitted = path.map((row, k) => rows.map((e) => e.reduce((sum, one, t) => sum + one * (row[t] - start[k]), 0)));
    return {
      start,
      goal: path.map((row) => row[row.length - 1]),
      weights: fitted.map((row) => row.slice(0, -1)),
      velocity: fitted.map((row) => row[row.length - 1]),
    };
  }

  /** Shares of the basis functions at normalized time u, Eq. (2) and (3); they add up to 1. */
  function basis(data, u) {
    const center = (i) => Math.exp((-data.alpha * i) / (data.n - 1));
    const s = Math.exp(-data.alpha * u);
    const psi = Array.from({ length: data.n }, (_, i) => {
      const j = Math.min(i, data.n - 2);
      return Math.exp((Math.log(data.overlap) * (s - center(i)) ** 2) / (center(j) - center(j + 1)) ** 2);
    });
    const sum = psi.reduce((a, b) => a + b, 0);
    return psi.map((one) => one / sum);
  }

  /** The two attractors at sample t, each over K: what pulls to the goal, and what bends the way there. */
  function attractors(data, name, one, goal, path, t) {
    const u = t / (data.Phi.length - 1);
    const shares = basis(data, u);
    const s = Math.exp(-data.alpha * u);
    const pull = path.map((row, k) => K * (goal[k] - row[t]));
    const bend = path.map((row, k) => {
      const f = shares.reduce((sum, share, i) => sum + share * one.weights[k][i], 0) * ratioOf(name, one, goal, k);
      return name === "original" ? f : f + s * (one.start[k] - row[t]);
    });
    if (name !== "original") for (const k of pull.keys()) pull[k] *= 1 - s;
    return { pull, bend };
  }

  /** Points [time, x, y] of a drawing as a path of n even samples, a little smoothed. */
  function resampled(points, n) {
    const [first, last] = [points[0][0], points[points.length - 1][0]];
    let j = 0;
    const even = Array.from({ length: n }, (_, t) => {
      const time = first + ((last - first) * t) / (n - 1);
      while (j < points.length - 2 && points[j + 1][0] < time) j++;
      const [a, b] = [points[j], points[j + 1]];
      const share = Math.min(1, (time - a[0]) / (b[0] - a[0] || 1));
      return [a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])];
    });
    return [0, 1].map((k) =>
      even.map((_, t) => {
        const reach = Math.min(3, t, n - 1 - t); // both ends stay
        let sum = 0;
        for (let i = t - reach; i <= t + reach; i++) sum += even[i][k];
        return sum / (2 * reach + 1);
      }),
    );
  }

  if (typeof module !== "undefined") module.exports = { decode, encode, basis, attractors, resampled };
  if (typeof document === "undefined") return;

  const SCALE = 5.6; // pixels per millimeter
  const [LEFT, TOP, WIDE, HIGH] = [-38, 30, 72, 62]; // millimeters
  const ROW = 130; // pixels of a row of weights
  const svgNode = (name, attributes, parent) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    parent.append(node);
    return node;
  };
  const toPixels = ([x, y]) => [(x - LEFT) * SCALE, (TOP - y) * SCALE];
  const toMillimeters = ([x, y]) => [x / SCALE + LEFT, TOP - y / SCALE];
  const line = (points) => points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("");
  const planePath = (path) => line(path[0].map((x, t) => toPixels([x, path[1][t]])));
  const within = (value, low, high) => Math.min(high, Math.max(low, value));
  const MOST = 8; // times as much of the plane as usual may come into view

  /** The view that holds all points: as usual, or wider about the same center. */
  function viewOf(points) {
    const half = [(WIDE * SCALE) / 2, (HIGH * SCALE) / 2];
    const reach = points.flatMap((point) => point.map((value, k) => (Math.abs(value - half[k]) + 4) / half[k]));
    const wider = within(Math.max(...reach), 1, MOST);
    return [...half.map((one) => one * (1 - wider)), ...half.map((one) => 2 * one * wider)].join(" ");
  }
  const inPlane = ([x, y]) => [within(x, LEFT + 1, LEFT + WIDE - 1), within(y, TOP - HIGH + 1, TOP - 1)];

  function start(root) {
    const data = JSON.parse(root.querySelector("script").textContent);
    const n = data.Phi.length;
    const state = { name: "bio-inspired", one: encode(data, "bio-inspired", data.shown), shown: data.shown, t: 0 };
    state.goal = [...state.one.goal];
    const usual = 1.6 * Math.max(...state.one.weights.flat().map(Math.abs));
    let most = usual; // the weight at the upper end of a row
    const drawings = root.querySelector(".drawings");
    const parts = { ...makePlane(drawings), ...makeWeights(drawings, data) };
    const slider = root.querySelector("input");

    function draw() {
      const path = decode(data, state.name, state.one, state.goal);
      const dot = (node, [x, y]) => {
        node.setAttribute("cx", x);
        node.setAttribute("cy", y);
      };
      parts.shown.setAttribute("d", planePath(state.shown));
      parts.path.setAttribute("d", planePath(path));
      parts.plane.setAttribute("viewBox", viewOf(path[0].map((x, t) => toPixels([x, path[1][t]]))));
      dot(parts.start, toPixels(state.one.start));
      dot(parts.now, toPixels(path.map((row) => row[state.t])));
      parts.goal.setAttribute("transform", `translate(${toPixels(state.goal)})`);
      parts.goal.setAttribute("aria-valuenow", state.goal[0].toFixed(1));
      parts.goal.setAttribute(
        "aria-valuetext",
        `x ${state.goal[0].toFixed(1)}, y ${state.goal[1].toFixed(1)} millimeters`,
      );
      const terms = attractors(data, state.name, state.one, state.goal, path, state.t);
      for (const kind of ["pull", "bend"])
        drawArrow(
          parts[kind],
          path.map((row) => row[state.t]),
          terms[kind],
        );
      for (const [k, row] of parts.rows.entries()) drawWeights(data, row, state.one.weights[k], most);
    }

    function drag(node, begin, move) {
      node.addEventListener("pointerdown", (event) => {
        event.preventDefault();
        event.stopPropagation();
        node.setPointerCapture(event.pointerId);
        begin(event);
        const on = (later) => move(later);
        const off = () => {
          node.removeEventListener("pointermove", on);
          node.dispatchEvent(new CustomEvent("drawn"));
        };
        node.addEventListener("pointermove", on);
        node.addEventListener("pointerup", off, { once: true });
        node.addEventListener("pointercancel", off, { once: true });
      });
    }

    function setGoal(x, y) {
      state.goal = inPlane([x, y]);
      draw();
    }

    function setWeight(k, i, value) {
      state.one.weights[k][i] = within(value, -most, most);
      draw();
    }

    let held; // where the plane is on the screen as a drag begins: while it goes on, the view may change
    const hold = () => {
      parts.goal.focus();
      held = parts.plane.getScreenCTM();
    };
    drag(parts.goal, hold, (event) => setGoal(...toMillimeters(at(parts.plane, event, held))));
    parts.goal.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!step) return;
      event.preventDefault();
      setGoal(...state.goal.map((value, k) => value + step[k] * (event.shiftKey ? 5 : 1)));
    });
    parts.rows.forEach((row, k) => {
      row.grips.forEach((grip, i) => {
        const move = (event) =>
          setWeight(k, i, (1 - (2 * (at(parts.weights, event)[1] - k * ROW - 20)) / (ROW - 30)) * most);
        const begin = (event) => {
          grip.focus();
          move(event);
        };
        drag(grip, begin, move);
        grip.addEventListener("keydown", (event) => {
          const step = { ArrowUp: 1, ArrowDown: -1, PageUp: 5, PageDown: -5 }[event.key];
          if (step === undefined && event.key !== "Home") return;
          event.preventDefault();
          setWeight(k, i, event.key === "Home" ? 0 : state.one.weights[k][i] + (step * most) / 40);
        });
      });
    });

    let points = [];
    const add = (event) => {
      points.push([event.timeStamp, ...inPlane(toMillimeters(at(parts.plane, event)))]);
      parts.pen.setAttribute("d", line(points.map(([, x, y]) => toPixels([x, y]))));
    };
    const begin = (event) => {
      points = [];
      add(event);
    };
    drag(parts.plane, begin, add);
    parts.plane.addEventListener("drawn", () => {
      parts.pen.setAttribute("d", "");
      if (points.length > 8) learn(resampled(points, n));
    });

    function fit() {
      state.one = encode(data, state.name, state.shown);
      most = Math.max(usual, ...state.one.weights.flat().map(Math.abs));
    }

    function learn(path) {
      state.shown = path;
      fit();
      state.goal = [...state.one.goal];
      draw();
    }

    const actions = {
      again: () => learn(data.shown),
      spring: () => {
        for (const row of state.one.weights) row.fill(0);
        state.one.velocity.fill(0);
        draw();
      },
    };
    for (const [name, act] of Object.entries(actions))
      root.querySelector(`[data-act="${name}"]`).addEventListener("click", act);
    root.querySelector("select").addEventListener("change", (event) => {
      state.name = event.target.value;
      fit();
      draw();
    });
    slider.max = n - 1;
    slider.addEventListener("input", () => {
      state.t = Number(slider.value);
      draw();
    });
    draw();
    root.hidden = false;
    for (const picture of document.querySelectorAll(".primitive-picture")) picture.hidden = true;
  }

  /** Where a pointer is, in the drawing's own pixels. */
  function at(svg, event, place = svg.getScreenCTM()) {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(place.inverse());
    return [point.x, point.y];
  }

  function makePlane(parent) {
    const size = `0 0 ${WIDE * SCALE} ${HIGH * SCALE}`;
    const label = "The movement in the plane: draw a movement, or move its goal";
    const plane = svgNode("svg", { viewBox: size, role: "group", "aria-label": label }, parent);
    svgNode("rect", { width: "100%", height: "100%", fill: "transparent" }, plane);
    const made = { plane };
    for (const name of ["shown", "path", "pen"]) made[name] = svgNode("path", { class: name }, plane);
    for (const name of ["pull", "bend"]) made[name] = svgNode("g", { class: name }, plane);
    made.start = svgNode("circle", { class: "start", r: 5 }, plane);
    made.now = svgNode("circle", { class: "now", r: 7 }, plane);
    const slider = { class: "goal", tabindex: 0, role: "slider", "aria-label": "goal, moved with the arrow keys" };
    made.goal = svgNode("g", slider, plane);
    svgNode("circle", { r: 18 }, made.goal);
    const star = Array.from({ length: 10 }, (_, i) => [i % 2 ? 4.5 : 11, (Math.PI * i) / 5 - Math.PI / 2]);
    svgNode("path", { d: `${line(star.map(([r, a]) => [r * Math.cos(a), r * Math.sin(a)]))}Z` }, made.goal);
    return made;
  }

  function makeWeights(parent, data) {
    const size = `0 0 400 ${2 * ROW}`;
    const weights = svgNode("svg", { viewBox: size, role: "group", "aria-label": "The weights of x and of y" }, parent);
    const wide = 400 / data.n;
    const rows = ["x", "y"].map((name, k) => {
      const row = svgNode("g", { transform: `translate(0 ${k * ROW})` }, weights);
      svgNode("text", { x: 4, y: 14 }, row).textContent = `weights of ${name}, and the forcing term over time`;
      svgNode("line", { class: "axis", x1: 0, x2: 400, y1: (ROW + 10) / 2, y2: (ROW + 10) / 2 }, row);
      const place = (i) => ({ x: i * wide + 0.15 * wide, width: 0.7 * wide });
      const bars = Array.from({ length: data.n }, (_, i) => svgNode("rect", { class: "bar", ...place(i) }, row));
      const forcing = svgNode("path", { class: "forcing" }, row);
      const grips = bars.map((_, i) => {
        const name_ = `weight ${i + 1} of ${name}`;
        const slider = { tabindex: 0, role: "slider", "aria-orientation": "vertical", "aria-label": name_ };
        return svgNode("rect", { class: "grip", ...place(i), y: 20, height: ROW - 30, ...slider }, row);
      });
      return { bars, grips, forcing };
    });
    return { weights, rows };
  }

  function drawWeights(data, row, values, most) {
    const middle = (ROW + 10) / 2;
    const height = (value) => (value / most) * ((ROW - 30) / 2);
    values.forEach((value, i) => {
      row.bars[i].setAttribute("y", middle - Math.max(0, height(value)));
      row.bars[i].setAttribute("height", Math.abs(height(value)));
      row.grips[i].setAttribute("aria-valuenow", value.toFixed(1));
      row.grips[i].setAttribute("aria-valuemin", (-most).toFixed(1));
      row.grips[i].setAttribute("aria-valuemax", most.toFixed(1));
    });
    const wide = 400 / data.n;
    const points = Array.from({ length: 101 }, (_, t) => {
      const f = basis(data, t / 100).reduce((sum, share, i) => sum + share * values[i], 0);
      return [wide / 2 + ((400 - wide) * t) / 100, middle - height(f)];
    });
    row.forcing.setAttribute("d", line(points));
  }

  /** From a point in the plane, half as long as the term over K is. */
  function drawArrow(group, from, term) {
    const [a, b] = [toPixels(from), toPixels(from.map((value, k) => value + 0.5 * term[k]))];
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    const length = Math.hypot(dx, dy);
    group.replaceChildren();
    if (length < 6) return;
    const [ux, uy] = [dx / length, dy / length];
    svgNode("path", { d: line([a, [b[0] - 8 * ux, b[1] - 8 * uy]]), "fill-opacity": 0 }, group);
    const head = [
      b,
      [b[0] - 10 * ux - 5 * uy, b[1] - 10 * uy + 5 * ux],
      [b[0] - 10 * ux + 5 * uy, b[1] - 10 * uy - 5 * ux],
    ];
    svgNode("path", { d: `${line(head)}Z`, "stroke-width": 0 }, group);
  }

  document.querySelectorAll(".primitive").forEach(start);
})();
