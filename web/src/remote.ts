// The worker as the page sees it: questions and promises.

import type { FromWorker, OpenedModel, Question, Setup, Source, ToWorker } from "./protocol";

export interface Reply<T> { json: T; numbers: ArrayBuffer; milliseconds: number }

type Message = ToWorker extends infer M ? (M extends ToWorker ? Omit<M, "id"> : never) : never;

export class Remote {
  private waiting = new Map<number, { done: (r: FromWorker) => void; failed: (error: Error) => void }>();
  private next = 0;

  private constructor(private worker: Worker) {
    worker.onerror = worker.onmessageerror = () => {
      this.waiting.forEach((w) => w.failed(new Error("the worker that decodes and draws has failed: load the page again")));
      this.waiting.clear();
    };
    worker.onmessage = ({ data }: MessageEvent<FromWorker>) => {
      this.waiting.get(data.id)?.done(data);
      this.waiting.delete(data.id);
    };
  }

  /** Starts the worker and its engine. */
  static async start(setup: Setup): Promise<Remote> {
    const source = document.getElementById("worker")?.textContent ?? "";
    const remote = new Remote(new Worker(URL.createObjectURL(new Blob([source], { type: "text/javascript" }))));
    const engine = await bytesOf(setup.engine);
    // A server sends it as it is; the one file holds it compressed.
    await remote.send({ do: "start", engine, gzip: setup.engine.element !== undefined }, [engine]);
    return remote;
  }

  /** Begins to decode a model; `decode` goes on. */
  async open(source: Source): Promise<Reply<OpenedModel>> {
    const bytes = await bytesOf(source);
    return replied(await this.send({ do: "open", bytes }, [bytes]));
  }

  /** Asks; `numbers`, which are handed over, go with the question. */
  async ask<T>(question: Question, numbers?: ArrayBuffer): Promise<Reply<T>> {
    return replied(await this.send({ do: "ask", question, numbers }, numbers ? [numbers] : []));
  }

  private send(message: Message, transfer: Transferable[]): Promise<FromWorker> {
    const id = this.next++;
    return new Promise((resolve, reject) => {
      const done = (r: FromWorker) => (r.error === undefined ? resolve(r) : reject(new Error(r.error)));
      this.waiting.set(id, { done, failed: reject });
      this.worker.postMessage({ ...message, id }, transfer);
    });
  }
}

const replied = <T>({ json, numbers, milliseconds }: FromWorker): Reply<T> =>
  ({ json: json as T, numbers: numbers ?? new ArrayBuffer(0), milliseconds });

/** The bytes of a source. */
export async function bytesOf({ url, element }: Source): Promise<ArrayBuffer> {
  if (url !== undefined) {
    const answer = await fetch(url);
    if (!answer.ok) throw new Error(`${url}: the server answers ${answer.status}`);
    return answer.arrayBuffer();
  }
  const node = document.getElementById(element ?? "");
  const text = node?.textContent ?? "";
  node?.remove();
  return unpacked(text);
}

function unpacked(base64: string): ArrayBuffer {
  const native = (Uint8Array as unknown as { fromBase64?: (text: string) => Uint8Array<ArrayBuffer> }).fromBase64;
  if (native) return native.call(Uint8Array, base64).buffer;
  const binary = atob(base64);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes.buffer;
}
