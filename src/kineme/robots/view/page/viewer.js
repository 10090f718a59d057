// The page's script: time moves the arm, the trace of its tip, and the cursors of the charts.
(() => {
  /** @type {any} What is shown. */
  let data = null;
  const byId = (id) => document.getElementById(id);
  const [play, now, canvas] = ["play", "now", "canvas"].map(byId);
  const reset = /** @type {HTMLButtonElement} */ (byId("reset"));
  const slider = /** @type {HTMLInputElement} */ (byId("time"));
  const speed = /** @type {HTMLSelectElement} */ (byId("speed"));
  let times = [0];
  let duration = 0;
  let charts = [];
  let time = 0;
  let last = null; // when the page was drawn last, while it plays
  const api = Object.assign(window, {
    kineme: {
      load,
      show,
      pose,
      play: () => setPlaying(true),
      moved: null,
      tip: () => view?.tip(),
      at: (end) => view?.at(end),
      frames: () => view?.frames(),
      picture: () => view?.picture() ?? null,
    },
  }).kineme;
  const view = sceneOrNothing();

  /** Show a movement, or an arm at rest. */
  function load(next) {
    data = next;
    times = data.times;
    duration = times[times.length - 1];
    charts = [...document.querySelectorAll(".chart")].map((chart) => ({
      cursor: chart.querySelector(".cursor"),
      output: chart.querySelector("output"),
      width: chart.querySelector("svg").viewBox.baseVal.width,
    }));
    byId("legend-wanted").hidden = !data.wanted.length;
    setPlaying(false);
    view?.load();
    show(0);
  }

  /** Bend the joints, whatever the movement says. @param {number[]} joints */
  function pose(joints) {
    view?.show(joints, 0);
  }

  /** The last sample at or before a time, and how far the time lies between it and the next one. */
  function sampleAt(at) {
    let low = 0;
    let high = times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= at) low = middle;
      else high = middle;
    }
    const share = high > low ? Math.min(Math.max((at - times[low]) / (times[high] - times[low]), 0), 1) : 0;
    return share === 1 ? [high, 0] : [low, share];
  }

  /** A row between samples. @param {number[][]} rows @param {number[]} sample */
  function between(rows, [i, share]) {
    return share === 0 ? rows[i] : rows[i].map((value, k) => value + share * (rows[i + 1][k] - value));
  }

  function show(at) {
    time = Math.min(Math.max(at, 0), duration);
    const sample = sampleAt(time);
    const joints = between(data.positions, sample);
    const values = [...joints, ...data.steps.map((channel) => channel[sample[0]])];
    const said = `${time.toFixed(2)} s`;
    slider.value = String((Number(slider.max) * time) / (duration || 1));
    slider.setAttribute("aria-valuetext", `${time.toFixed(2)} of ${duration.toFixed(2)} seconds`);
    now.textContent = said + (time < data.begins ? " approach" : "");
    charts.forEach((chart, k) => {
      const x = String((chart.width * time) / (duration || 1));
      chart.cursor.setAttribute("x1", x);
      chart.cursor.setAttribute("x2", x);
      const unit = chart.output.dataset.unit;
      chart.output.textContent = unit ? `${values[k].toFixed(3)} ${unit}` : String(values[k]);
    });
    if (view) view.show(joints, sample[0]);
  }

  function setPlaying(on) {
    last = on ? performance.now() : null;
    play.textContent = on ? "Pause" : "Play";
    if (on && time >= duration) show(0);
    if (on) requestAnimationFrame(tick);
  }

  function tick(at) {
    if (last === null) return;
    show(time + (Math.max(at - last, 0) / 1000) * Number(speed.value));
    last = at;
    if (time >= duration) setPlaying(false);
    else requestAnimationFrame(tick);
  }

  slider.addEventListener("input", () => {
    setPlaying(false);
    show((duration * Number(slider.value)) / Number(slider.max));
  });
  play.addEventListener("click", () => setPlaying(last === null));
  document.addEventListener("keydown", (event) => {
    const target = /** @type {Element} */ (event.target);
    if (event.key !== " " || target.closest("button, select, summary")) return;
    event.preventDefault();
    setPlaying(last === null);
  });
  if (byId("data")) load(JSON.parse(byId("data").textContent)); // else it is told what to show

  /** The scene, or null where the browser cannot draw one: the charts and the table still work. */
  function sceneOrNothing() {
    try {
      return makeScene();
    } catch (error) {
      const problem = byId("problem");
      const why = error.message.replace(/\.$/, "");
      problem.textContent = `The arm cannot be drawn here: ${why}. The joints and the checks are shown.`;
      /** @type {HTMLElement} */ (document.querySelector(".legend")).hidden = true;
      problem.hidden = false;
      reset.disabled = true;
      return null;
    }
  }

  function makeScene() {
    const T = globalThis.scene; // of vendor/scene.min.js
    const renderer = new T.WebGLRenderer({ canvas, antialias: true });
    const world = new T.Scene();
    const camera = new T.PerspectiveCamera(40, 1, 0.01, 100);
    camera.up.set(0, 0, 1);
    const dark = window.matchMedia("(prefers-color-scheme: dark)");
    let [grid, held, frames, asked, reach, first] = [null, null, 0, 0, 1, 1];
    let middle = new T.Vector3();
    /** @type {any} What belongs to the movement: the arm, its paths, start and goal. */
    const shown = { arm: null, urdf: "", parts: [], ends: {} };

    world.add(new T.HemisphereLight(0xffffff, 0x8890a0, 2.2));
    const sun = new T.DirectionalLight(0xffffff, 1.8);
    sun.position.set(1, -1.5, 2);
    world.add(sun);

    canvas.addEventListener("pointerdown", grab); // before the view is turned
    const controls = new T.OrbitControls(camera, canvas);
    controls.addEventListener("change", draw);
    reset.addEventListener("click", home);
    canvas.addEventListener("keydown", turn);
    dark.addEventListener("change", paint);
    new ResizeObserver(fit).observe(canvas.parentElement);

    function load() {
      const isSame = !data.urdf || shown.urdf === data.urdf;
      world.remove(...shown.parts);
      if (!isSame) {
        if (shown.arm) world.remove(shown.arm);
        shown.arm = readArm(T, () => draw());
        world.add(shown.arm);
      }
      const size = extent(T, shown.arm);
      if (!isSame) [middle, reach] = size;
      const thin = Math.max(0.0022 * reach, 0.0006);
      first = Math.max(sampleAt(data.begins)[0], 1);
      const { executed, wanted, colors } = data;
      const [before, after] = [executed.slice(0, first + 1), executed.slice(first)];
      const light = tube(T, wanted, 3.2 * thin, colors.wanted, 1, 0.5);
      const approach = tube(T, before, 1.7 * thin, colors.approach, 3);
      const movement = tube(T, after, 1.7 * thin, colors.executed, 3);
      const behind = tube(T, after, 0.7 * thin, colors.executed, 4, 0.3); // where the arm hides it
      behind.material.depthTest = false;
      const whole = [tube(T, before, 0.7 * thin, colors.approach, 2), tube(T, after, 0.7 * thin, colors.executed, 2)];
      const larger = api.moved ? 1.8 : 1; // to be taken hold of
      const ends = {
        start: mark(T, new T.SphereGeometry(4.5 * thin * larger), data.start, colors.executed),
        goal: mark(T, new T.OctahedronGeometry(6.5 * thin * larger), data.goal, colors.goal),
      };
      const parts = executed.length > 1 ? [...whole, approach, movement, behind, ends.start, ends.goal] : [];
      if (wanted.length > 1) parts.push(light);
      if (parts.length) world.add(...parts);
      Object.assign(shown, { urdf: data.urdf || shown.urdf, parts, ends, light, approach, movement });
      paint();
      if (isSame) return;
      resize();
      home();
    }

    /** Pixels of a place on the canvas. */
    function onScreen(place) {
      camera.updateMatrixWorld();
      const { x, y } = place.clone().project(camera);
      return [((1 + x) * canvas.clientWidth) / 2, ((1 - y) * canvas.clientHeight) / 2];
    }
    /** Take hold of the start or the goal, where somebody hears of it. @param {PointerEvent} event */
    function grab(event) {
      if (!api.moved || !shown.parts.length || event.button !== 0) return;
      const box = canvas.getBoundingClientRect();
      const near = (name) => {
        const [x, y] = onScreen(shown.ends[name].position);
        return Math.hypot(x - event.clientX + box.left, y - event.clientY + box.top);
      };
      held = near("goal") <= near("start") ? "goal" : "start";
      if (near(held) > 22) return;
      controls.enabled = false;
      canvas.setPointerCapture(event.pointerId);
      const { position } = shown.ends[held];
      const begin = position.clone();
      const depth = begin.clone().project(camera).z;
      // The goal of a drawing stays in its plane.
      const height = data.start[2];
      const isFlat =
        held === "goal" && data.wanted[0] && data.wanted.every((point) => Math.abs(point[2] - height) < 1e-3);
      const go = (now) => {
        const [x, y] = [(2 * (now.clientX - box.left)) / box.width - 1, 1 - (2 * (now.clientY - box.top)) / box.height];
        const place = new T.Vector3(x, y, depth).unproject(camera);
        if (isFlat) {
          const ray = place.clone().sub(camera.position);
          const share = (height - camera.position.z) / ray.z;
          if (!(share > 0 && share * ray.length() < 20)) return;
          place.copy(camera.position).addScaledVector(ray, share);
        }
        position.copy(place);
        draw();
      };
      const end = () => {
        canvas.removeEventListener("pointermove", go);
        controls.enabled = true;
        if (position.distanceTo(begin) > 1e-6) api.moved(held, position.toArray());
      };
      canvas.addEventListener("pointermove", go);
      canvas.addEventListener("lostpointercapture", end, { once: true });
    }
    function home() {
      controls.target.copy(middle);
      const back = camera.aspect < 1 ? 1 / camera.aspect : 1;
      const ahead = data.executed.reduce(([x, y], point) => [x + point[0], y + point[1]], [0, 0]);
      const around = Math.atan2(ahead[1], ahead[0]) - 0.86; // beside the arm, the movement in front of it
      const from = new T.Vector3(Math.cos(around), Math.sin(around), 0.45).normalize();
      camera.position.copy(middle).addScaledVector(from, 1.55 * reach * back);
      controls.update();
      draw();
    }
    /** At once: a canvas of another size is empty. */
    function fit() {
      if (resize()) drawNow();
    }
    function resize() {
      const { clientWidth, clientHeight } = canvas.parentElement;
      if (!clientWidth || !clientHeight) return false;
      renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
      renderer.setSize(clientWidth, clientHeight, false);
      camera.aspect = clientWidth / clientHeight;
      camera.updateProjectionMatrix();
      return true;
    }
    function paint() {
      const lines = dark.matches ? [0x59616b, 0x343a42] : [0xa9afb8, 0xd3d7dd];
      world.background = new T.Color(dark.matches ? 0x1e2226 : 0xf4f5f7);
      if (shown.light) shown.light.material.opacity = dark.matches ? 0.8 : 0.5;
      if (grid) world.remove(grid);
      grid = new T.GridHelper(2.4 * Math.max(reach, 0.2), 24, ...lines);
      grid.rotation.x = Math.PI / 2;
      world.add(grid);
      draw();
    }
    function turn(event) {
      const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
      const nearer = { "+": 1 / 1.15, "=": 1 / 1.15, "-": 1.15 }[event.key];
      if (!nearer && !steps[event.key]) return;
      event.preventDefault();
      const away = camera.position.clone().sub(controls.target);
      const [around, down] = steps[event.key] ?? [0, 0];
      const length = away.length() * (nearer ?? 1);
      const height = Math.min(Math.max(Math.acos(away.z / away.length()) + 0.08 * down, 0.05), Math.PI - 0.05);
      const angle = Math.atan2(away.y, away.x) + 0.12 * around;
      const flat = length * Math.sin(height);
      away.set(flat * Math.cos(angle), flat * Math.sin(angle), length * Math.cos(height));
      camera.position.copy(controls.target).add(away);
      controls.update();
      draw();
    }
    /** Draw in the next frame, however often it is asked for until then. */
    function draw() {
      asked ||= requestAnimationFrame(drawNow);
    }
    function drawNow() {
      cancelAnimationFrame(asked);
      asked = 0;
      frames += 1;
      renderer.render(world, camera);
    }
    return {
      load,
      show(joints, sample) {
        bend(shown.arm, joints);
        shown.approach.show(sample);
        shown.movement.show(Math.max(sample - first, 0));
        draw();
      },
      tip() {
        shown.arm.updateMatrixWorld(true);
        return shown.arm.links[data.tip].getWorldPosition(new T.Vector3()).toArray();
      },
      at: (end) => onScreen(shown.ends[end].position),
      frames: () => frames,
      picture() {
        drawNow(); // what was drawn before is no longer there
        return renderer.domElement.toDataURL();
      },
    };
  }

  function readArm(T, changed) {
    // Textures of meshes are files of their own: none is requested.
    const manager = new T.LoadingManager().setURLModifier(
      () => "data:image/gif;base64,R0lGODlhAQABAIAAAP///wAAACH5BAAAAAAALAAAAAABAAEAAAICRAEAOw==",
    );
    const loader = new T.URDFLoader(manager);
    loader.loadMeshCb = (number, _, material, done) =>
      done(readMesh(T, manager, data.meshes[Number(number)], material));
    manager.onLoad = changed;
    const arm = loader.parse(data.urdf);
    for (const name of data.joints) arm.joints[name].ignoreLimits = true; // what is executed is shown, whatever it is
    return arm;
  }

  function readMesh(T, manager, mesh, material) {
    const bytes = Uint8Array.from(atob(mesh.content), (mark) => mark.charCodeAt(0));
    if (mesh.kind === "stl") return new T.Mesh(new T.STLLoader().parse(bytes.buffer), material);
    return new T.ColladaLoader(manager).parse(new TextDecoder().decode(bytes), "").scene;
  }

  function bend(arm, joints) {
    for (const [k, name] of data.joints.entries()) arm.setJointValue(name, joints[k]);
  }

  /** The middle of what moves, and the size of the arm and its paths [m]. */
  function extent(T, arm) {
    const low = [0, 0, 0];
    const high = [0, 0, 0];
    const include = (point) => {
      for (const k of low.keys()) [low[k], high[k]] = [Math.min(low[k], point[k]), Math.max(high[k], point[k])];
    };
    data.executed.forEach(include);
    data.wanted.forEach(include);
    for (const row of [
      data.positions[0],
      data.positions[data.positions.length >> 1],
      data.positions[data.positions.length - 1],
    ]) {
      bend(arm, row);
      arm.updateMatrixWorld(true);
      for (const link of Object.values(arm.links)) include(link.getWorldPosition(new T.Vector3()).toArray());
    }
    const middle = low.map((value, k) => (value + high[k]) / 2);
    return [new T.Vector3(...middle), Math.max(Math.hypot(...low.map((value, k) => high[k] - value)), 0.1)];
  }

  function mark(T, geometry, point, color) {
    const mesh = new T.Mesh(geometry, new T.MeshBasicMaterial({ color }));
    mesh.position.set(...point);
    return mesh;
  }

  /** A tube along points, drawn over those of a lower order; `show` draws the part of it up to one of the points. */
  function tube(T, points, radius, color, order, opacity = 1) {
    const sides = 8;
    const corners = [];
    const faces = [];
    let side = new T.Vector3(0, 0, 1);
    let along = new T.Vector3(1, 0, 0);
    points.forEach((point, i) => {
      const step = new T.Vector3(...(points[i + 1] ?? point)).sub(new T.Vector3(...(points[i - 1] ?? point)));
      if (step.length() > 1e-9) along = step.normalize();
      if (Math.abs(along.dot(side)) > 0.99)
        side = new T.Vector3(Math.abs(along.x) < 0.9 ? 1 : 0, Math.abs(along.x) < 0.9 ? 0 : 1, 0);
      side = side.clone().addScaledVector(along, -along.dot(side)).normalize();
      const other = along.clone().cross(side);
      for (let k = 0; k < sides; k += 1) {
        const angle = (2 * Math.PI * k) / sides;
        const [c, s] = [radius * Math.cos(angle), radius * Math.sin(angle)];
        corners.push(
          point[0] + c * side.x + s * other.x,
          point[1] + c * side.y + s * other.y,
          point[2] + c * side.z + s * other.z,
        );
        const [a, b] = [sides * i + k, sides * i + ((k + 1) % sides)];
        if (i + 1 < points.length) faces.push(a, b, a + sides, b, b + sides, a + sides);
      }
    });
    const geometry = new T.BufferGeometry();
    geometry.setAttribute("position", new T.Float32BufferAttribute(corners, 3));
    geometry.setIndex(faces);
    const mesh = new T.Mesh(
      geometry,
      new T.MeshBasicMaterial({ color, opacity, transparent: true, depthWrite: opacity === 1 }),
    );
    mesh.renderOrder = order;
    mesh.show = (sample) => geometry.setDrawRange(0, 6 * sides * sample);
    mesh.frustumCulled = false;
    return mesh;
  }
})();
