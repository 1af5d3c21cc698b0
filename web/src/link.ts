/** The connection: the newest state, frames, signs of life, stop. */

import { decode, post, tab, type Frame, type State, type Strokes } from "./wire";

type Listener = (state: State) => void;

const RETRY_MS = 500;
/** A socket that says nothing for so long is taken for dead. The server sends the state four times a second in a run. */
const SILENT_MS = 3000;
const BEAT_MS = 100;

export class Link {
  state: State | null = null;
  connected = false;
  /** Signs of life that were sent on this connection; each carries the next number. */
  beats = 0;
  onframe: (frame: Frame) => void = () => {};
  onstrokes: (strokes: Strokes) => void = () => {};
  /** The state of the connection, or of being in front, has changed. */
  onchange: () => void = () => {};
  private listeners: Listener[] = [];
  private socket: WebSocket | null = null;
  private view: object | null = null;
  private heard = 0;
  private front = true;

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

  /** Whether this page is visible and has the focus: only then it may control. */
  inFront(): boolean {
    return document.visibilityState === "visible" && document.hasFocus();
  }

  show(view: object): void {
    this.view = view;
    this.send({ view });
  }

  /** Stop, over both ways. False if neither is there. */
  async stop(): Promise<boolean> {
    const sent = this.send({ stop: true });
    try {
      await post("/api/stop", {});
      return true;
    } catch {
      return sent;
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
    const live = this.state?.phase === "live";
    if (this.connected && live && performance.now() - this.heard > SILENT_MS) this.socket?.close();
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
    socket.onopen = () => {
      this.heard = performance.now();
      this.connected = true;
      if (this.view) this.send({ view: this.view });
      this.onchange();
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      this.heard = performance.now();
      if (typeof event.data === "string") {
        const said = JSON.parse(event.data) as { state?: State; tab?: string };
        if (said.tab) {
          tab.id = said.tab;
          this.beats = 0;
        }
        if (said.state) this.take(said.state);
        return;
      }
      const frame = decode(event.data);
      if (frame === null) return;
      if ("pairs" in frame) this.onstrokes(frame);
      else this.onframe(frame);
    };
    socket.onclose = () => {
      if (this.socket !== socket) return;
      const was = this.connected;
      this.connected = false;
      if (was) this.onchange();
      window.setTimeout(() => this.open(), RETRY_MS);
    };
  }
}
