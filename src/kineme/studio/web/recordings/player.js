// The playhead of a recording: played, stepped through, with the video of a camera beside it where there is one.
import { byId, offer, write } from "../parts/elements.js";
import { clamp } from "../parts/geometry.js";

const STEP = 0.1; // of an arrow key [s]; ten times as much with Shift
const NEAR = 0.05; // a video that is so near the playhead stays where it is [s]

export class Player {
  constructor(moved) {
    this.moved = moved;
    this.at = 0;
    this.end = 0;
    this.playing = false;
    this.last = 0; // when the playhead was moved last [ms]
    this.videos = [];
    /** @type {Video|null} The one that is shown, unless the browser cannot play it. */
    this.video = null;
    this.film = byId("video");
    this.film.onerror = () => this.fail();
    this.film.onloadedmetadata = () => (this.film.videoWidth ? this.follow() : this.fail());
    byId("video-start").oninput = () => {
      if (this.video) this.video.start = byId("video-start").valueAsNumber || 0;
      this.follow();
    };
    byId("own-video").onchange = () => {
      const [file] = byId("own-video").files;
      if (file) this.add(file);
    };
    byId("camera").onchange = () => this.show(byId("camera").selectedIndex);
    byId("play-recording").onclick = () => this.toggle();
    byId("playhead").oninput = () => this.seek(byId("playhead").valueAsNumber);
    byId("playhead").onkeydown = (event) => this.key(event);
  }

  /** Another recording. @param {Video[]} videos */
  open(end, videos) {
    this.pause();
    Object.assign(this, { end, videos });
    byId("playhead").max = String(end);
    this.list(0);
    this.seek(0);
  }

  /** A video of the person's, which stays in the browser. */
  add(file) {
    this.videos.push({ camera: file.name, start: 0, codec: null, address: URL.createObjectURL(file), own: true });
    this.list(this.videos.length - 1);
    return true;
  }

  /** Offer all videos, and show one. */
  list(k) {
    byId("video-part").hidden = !this.videos.length;
    byId("camera-part").hidden = this.videos.length < 2;
    const cameras = this.videos.map(({ camera }) => camera);
    offer(byId("camera"), cameras);
    byId("camera").selectedIndex = k;
    this.show(k);
  }

  /** The video of a camera. */
  show(k) {
    this.video = this.videos[k] ?? null;
    this.film.hidden = !this.video;
    byId("video-start-part").hidden = !this.video?.own;
    byId("video-start").value = String(this.video?.start ?? 0);
    write(byId("video-note"), "");
    if (!this.video) {
      this.film.removeAttribute("src");
      return this.film.load();
    }
    this.film.setAttribute("aria-label", `Video of ${this.video.camera}`);
    this.film.src = this.video.address;
  }

  /** Say that the browser cannot play what is shown; the playhead goes on without it. */
  fail() {
    if (!this.video) return;
    const { camera, codec } = this.video;
    const name = codec ? `${camera} (${codec})` : camera;
    write(byId("video-note"), `This browser cannot play the video of ${name}. The signals go on without it.`);
    this.video = null;
    this.film.hidden = true;
  }

  /** Put the video where the playhead is. */
  follow() {
    if (!this.video || !this.film.readyState) return;
    const time = this.video.start + this.at;
    if (Math.abs(this.film.currentTime - time) > NEAR) this.film.currentTime = time;
  }

  toggle() {
    if (this.playing || !this.end) return this.pause();
    if (this.at >= this.end) this.seek(0);
    this.playing = true;
    write(byId("play-recording"), "Pause");
    this.last = performance.now();
    requestAnimationFrame(() => this.tick());
  }

  pause() {
    this.playing = false;
    write(byId("play-recording"), "Play");
    this.film.pause();
  }

  /** The playhead goes with the video where one plays, and with the clock else. */
  tick() {
    if (!this.playing) return;
    const now = performance.now();
    const due = this.video && this.film.readyState && !this.film.ended && this.at + this.video.start >= 0;
    if (due && this.film.paused) {
      this.follow();
      this.film.play().catch(() => {}); // an error of the video says more
    }
    if (due && !this.film.paused) this.go(this.film.currentTime - this.video.start);
    else this.go(this.at + (now - this.last) / 1000);
    this.last = now;
    if (this.at >= this.end) this.pause();
    else requestAnimationFrame(() => this.tick());
  }

  /** Put the playhead at a time [s], and the video with it. */
  seek(time) {
    this.go(time);
    this.follow();
  }

  go(time) {
    this.at = clamp(time, 0, this.end);
    byId("playhead").value = String(this.at);
    byId("playhead").setAttribute("aria-valuetext", `${this.at.toFixed(2)} seconds`);
    write(byId("playhead-text"), `${this.at.toFixed(2)} of ${this.end.toFixed(2)} s`);
    this.moved(this.at);
  }

  /** Space plays and pauses, arrow keys step. */
  key(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === " ") this.toggle();
    else if (step) this.seek(this.at + step * STEP * (event.shiftKey ? 10 : 1));
    else return;
    event.preventDefault();
  }
}
