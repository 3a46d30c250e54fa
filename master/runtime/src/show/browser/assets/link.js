// The way to the master: words both ways, pictures one way; it comes back by itself when it was cut.

const BETWEEN_TRIES_MS = [250, 500, 1000, 2000, 4000];

export class Link {
  /** `on` has a function for each word that the master tells, and `picture`, `up` and `down`. */
  constructor(on) {
    this.on = on;
    this.tries = 0;
    this.bytes = 0;
    this.connect();
  }

  connect() {
    const address = new URL("/socket", location.href);
    address.protocol = address.protocol.replace("http", "ws");
    address.search = location.search;
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => { this.tries = this.number = 0; this.on.up(); };
    socket.onclose = () => {
      this.on.down();
      setTimeout(() => this.connect(), BETWEEN_TRIES_MS[Math.min(this.tries++, BETWEEN_TRIES_MS.length - 1)]);
    };
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") {
        this.bytes += data.length;
        const words = JSON.parse(data);
        this.on[words.tell]?.(words);
      } else {
        this.bytes += data.byteLength;
        this.picture(data, socket);
      }
    };
  }

  /** Decodes a picture, has it drawn unless a newer one was, and says so: several may be on their way. */
  async picture(data, socket) {
    const length = new DataView(data).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
    try {
      const image = await createImageBitmap(new Blob([new Uint8Array(data, 4 + length)], { type: header.kind }));
      if (header.number >= this.number) this.on.picture(header, image);
      this.number = Math.max(this.number, header.number);
      image.close();
    } finally {
      if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ say: "drawn", number: header.number }));
    }
  }

  say(word, rest = {}) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ say: word, ...rest }));
  }
}
