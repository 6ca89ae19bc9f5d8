/** Films the view with the browser's own recorder. */

import { download } from "./picture.ts";

const FRAMES_PER_S = 30;
const BITS_PER_S = 8_000_000;
/** A film ends by itself here, because it is kept in memory until it is saved. */
const LONGEST_MS = 10 * 60_000;
const FORMATS = ["video/mp4;codecs=avc1.640028", "video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];

export class Film {
  private recorder: MediaRecorder | null = null;
  private parts: Blob[] = [];
  private timer = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly say: (text: string, state?: "plain" | "bad") => void,
  ) {}

  static get supported(): boolean {
    return typeof MediaRecorder !== "undefined" && "captureStream" in HTMLCanvasElement.prototype;
  }

  get running(): boolean {
    return this.recorder !== null;
  }

  start(): void {
    const format = FORMATS.find((name) => MediaRecorder.isTypeSupported(name));
    if (!format) {
      this.say("This browser has no film format for the view.", "bad");
      return;
    }
    this.parts = [];
    this.recorder = new MediaRecorder(this.canvas.captureStream(FRAMES_PER_S), {
      mimeType: format,
      videoBitsPerSecond: BITS_PER_S,
    });
    this.recorder.addEventListener("dataavailable", (event) => {
      if (event.data.size > 0) this.parts.push(event.data);
    });
    this.recorder.start(1000);
    this.timer = window.setTimeout(() => this.stop("trocar"), LONGEST_MS);
    this.say("Filming the view.");
  }

  stop(scene: string): void {
    const recorder = this.recorder;
    this.recorder = null;
    clearTimeout(this.timer);
    if (!recorder) return;
    recorder.addEventListener("stop", () => {
      const ending = recorder.mimeType.includes("mp4") ? "mp4" : "webm";
      const name = `${scene}.${ending}`;
      download(new Blob(this.parts, { type: recorder.mimeType }), name);
      this.parts = [];
      this.say(`Saved ${name}.`);
    });
    recorder.stop();
    for (const track of recorder.stream.getTracks()) track.stop();
  }
}
