/** The connection: the newest state, frames, signs of life, stop. */

import { decode, post, tab, type Frame, type State, type Strokes } from "./wire";

type Listener = (state: State) => void;

const RETRY_MS = 500;
/** A server that says nothing for so long is taken for lost: it says ten times a second that its last state holds. */
const SILENT_MS = 1000;
/** After so long another connection is tried: this one may never end by itself. */
const DEAD_MS = 3000;
const BEAT_MS = 100;

export class Link {
  state: State | null = null;
  /** Whether the state is how the rig stands: there is a connection, and it has said something within the last second. */
  connected = false;
  /** Stamp of the newest state that was seen; requests that give power carry it. */
  seen: number | null = null;
  /** Signs of life that were sent on this connection; each carries the next number. */
  beats = 0;
  onframe: (frame: Frame) => void = () => {};
  onstrokes: (strokes: Strokes) => void = () => {};
  /** The state of the connection, or of being in front, has changed. */
  onchange: () => void = () => {};
  private listeners: Listener[] = [];
  private socket: WebSocket | null = null;
  private view: object | null = null;
  private heard = performance.now();
  private quiet = 0;
  private front = true;
  private opened = 0;
  /** Whether this connection has told a state. */
  private told = false;

  start(): void {
    this.open();
    window.setInterval(() => this.beat(), BEAT_MS);
    // A page that is kept for the way back is gone for the console; when it comes back it connects anew, and controls nothing.
    window.addEventListener("pagehide", () => this.socket?.close());
    for (const name of ["visibilitychange", "focus", "blur"]) {
      (name === "visibilitychange" ? document : window).addEventListener(name, () => this.look());
    }
  }

  listen(listener: Listener): void {
    this.listeners.push(listener);
    if (this.state) listener(this.state);
  }

  /** A state from an answer to a request, or from the socket. */
  take(state: State): void {
    this.state = state;
    for (const listener of this.listeners) listener(state);
  }

  /** Whether this page is visible and its keys come here, not into a frame in it: only then it may control. */
  inFront(): boolean {
    return document.visibilityState === "visible" && document.hasFocus() && !(document.activeElement instanceof HTMLIFrameElement);
  }

  /** Seconds without news from the server. */
  silence(): number {
    return Math.floor((performance.now() - this.heard) / 1000);
  }

  /** Whether something has power or may get it, as far as this page knows: where it knows nothing, it may. */
  busy(): boolean {
    const state = this.state;
    return !state || !this.connected || (state.phase !== "idle" && state.phase !== "checking") || state.run?.power === true;
  }

  show(view: object): void {
    this.view = view;
    this.send({ view });
  }

  /** Stop, over both ways; whether the server has taken it. Calls `late` where it has not answered for a second. */
  async stop(late: () => void): Promise<boolean> {
    this.send({ stop: true });
    const timer = window.setTimeout(late, SILENT_MS);
    try {
      await post("/api/stop", {});
      return true;
    } catch {
      return false;
    } finally {
      window.clearTimeout(timer);
    }
  }

  private send(message: object): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  private beat(): void {
    this.look();
    if (this.connected && this.state?.you.controls && this.front) {
      if (this.send({ life: this.beats + 1 })) this.beats += 1;
    }
    const silent = performance.now() - this.heard;
    if (this.connected && silent > SILENT_MS) this.connected = false;
    const quiet = this.connected ? 0 : 1 + this.silence();
    if (quiet !== this.quiet) {
      this.quiet = quiet;
      this.onchange();
    }
    if (this.socket && silent > DEAD_MS && performance.now() - this.opened > DEAD_MS) this.leave(this.socket);
  }

  /** Give a connection up, and try another one. Its end need not be waited for. */
  private leave(socket: WebSocket): void {
    if (this.socket !== socket) return;
    this.socket = null;
    this.connected = false;
    tab.id = "";
    socket.close();
    this.onchange();
    window.setTimeout(() => this.open(), RETRY_MS);
  }

  private look(): void {
    const front = this.inFront();
    if (front !== this.front) {
      this.front = front;
      this.onchange();
    }
  }

  private open(): void {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/stream`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.opened = performance.now();
    socket.onopen = () => {
      if (this.socket === socket && this.view) this.send({ view: this.view });
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (this.socket !== socket) return;
      if (typeof event.data === "string") {
        const said = JSON.parse(event.data) as { state?: State; tab?: string; beat?: number };
        if (said.tab) {
          tab.id = said.tab;
          this.beats = 0;
        }
        if (typeof said.beat === "number") {
          this.seen = said.beat;
          this.heard = performance.now();
        }
        // Only a state makes the page live again: until it comes, an older one is shown.
        if (said.state) {
          this.connected = true;
          this.take(said.state);
        } else if (typeof said.beat === "number" && !this.connected && this.told) {
          this.connected = true;
          this.onchange();
        }
        if (said.state) this.told = true;
        else if (said.tab) this.told = false;
        return;
      }
      const frame = decode(event.data);
      if (frame === null) return;
      if ("pairs" in frame) this.onstrokes(frame);
      else this.onframe(frame);
    };
    socket.onclose = () => this.leave(socket);
  }
}
