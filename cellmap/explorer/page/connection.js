// The connection to the server: text with JSON, and binary messages with a header; see protocol.py.

const HEAD = 12;

export function unpack(buffer) {
  const head = new DataView(buffer);
  const magic = String.fromCharCode(...new Uint8Array(buffer, 0, 4));
  if (magic !== "CMAP" || head.getUint32(4, true) !== 1) {
    throw new Error("the server speaks another version: reload the page");
  }
  const length = head.getUint32(8, true);
  const facts = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, HEAD, length)));
  facts.data = new Uint8Array(buffer, HEAD + length);
  return facts;
}

// Returns a socket: that of a notebook where the page is in one of its frames, else one to the server of the page.
export function connect() {
  const notebook = window.frameElement?.cellmapConnect;
  return notebook ? notebook() : new WebSocket(new URL("connection", location.href).href.replace(/^http/, "ws"));
}

export class Connection {
  // `connect` returns a socket; `heard` maps types of messages to functions; `changed` is told whether there is an answer.
  constructor(connect, heard, changed) {
    this.connect = connect;
    this.heard = heard;
    this.changed = changed;
    this.number = 0;
    this.pending = new Map();
    this.delay = 500;
    this.open();
  }

  open() {
    this.socket = this.connect();
    this.socket.binaryType = "arraybuffer";
    this.socket.onmessage = (event) => this.receive(event.data);
    this.socket.onopen = () => { this.delay = 500; this.changed(true, ""); };
    this.socket.onclose = (event) => {
      for (const { reject } of this.pending.values()) reject(new Error("the connection was lost: press it again when it is back"));
      this.pending.clear();
      this.changed(false, event.reason);
      setTimeout(() => this.open(), this.delay);
      this.delay = Math.min(2 * this.delay, 8000);
    };
  }

  receive(data) {
    const message = typeof data === "string" ? JSON.parse(data) : unpack(data);
    const waiting = this.pending.get(message.request);
    if (waiting && message.type !== "frame") {
      this.pending.delete(message.request);
      if (message.type === "error") waiting.reject(Object.assign(new Error(message.message), message));
      else waiting.resolve(message);
    } else {
      this.heard[message.type]?.(message);
    }
  }

  // Sends a message under a number of its own, and returns that number.
  send(message) {
    const request = ++this.number;
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ ...message, request }));
    return request;
  }

  // Ends what was asked for under a number.
  cancel(request) {
    this.send({ type: "cancel", of: request });
  }

  // Sends a message, and promises its answer; `numbered` is told its number at once.
  ask(message, numbered = () => {}) {
    if (this.socket.readyState !== WebSocket.OPEN) return Promise.reject(new Error("the server cannot be reached"));
    return new Promise((resolve, reject) => {
      const request = this.send(message);
      this.pending.set(request, { resolve, reject });
      numbered(request);
    });
  }
}
