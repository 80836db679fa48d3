// The page's side of the worker: each query is a promise.

import type { WorkerResponse, OpenedModel, EngineQuery, Setup, Source, WorkerRequest } from "./protocol";

export interface EngineResponse<T> { json: T; numbers: ArrayBuffer; milliseconds: number }

type Message = WorkerRequest extends infer M ? (M extends WorkerRequest ? Omit<M, "id"> : never) : never;

export class EngineClient {
  private waiting = new Map<number, { done: (r: WorkerResponse) => void; failed: (error: Error) => void }>();
  private next = 0;

  private constructor(private worker: Worker) {
    worker.onerror = worker.onmessageerror = () => {
      this.waiting.forEach((w) => w.failed(new Error("the worker that decodes and draws has stopped: reload the page")));
      this.waiting.clear();
    };
    worker.onmessage = ({ data }: MessageEvent<WorkerResponse>) => {
      this.waiting.get(data.id)?.done(data);
      this.waiting.delete(data.id);
    };
  }

  /** Starts the worker and its engine. */
  static async start(setup: Setup): Promise<EngineClient> {
    const source = document.getElementById("worker")?.textContent ?? "";
    const remote = new EngineClient(new Worker(URL.createObjectURL(new Blob([source], { type: "text/javascript" }))));
    const engine = await bytesOf(setup.engine);
    // The offline page holds the engine compressed; a server sends it plain.
    await remote.send({ do: "start", engine, gzip: setup.engine.element !== undefined }, [engine]);
    return remote;
  }

  /** Opens a model and decodes its first part; `decode` queries continue. */
  async open(source: Source): Promise<EngineResponse<OpenedModel>> {
    const bytes = await bytesOf(source);
    return responseOf(await this.send({ do: "open", bytes }, [bytes]));
  }

  /** Opens a series by its first bytes, which hold the index and the first frame; `start` is their number. */
  async openSeries(source: Source): Promise<EngineResponse<OpenedModel> & { start: number }> {
    let bytes = await bytesOf(source, [0, SERIES_START]);
    for (;;) {
      const answer = responseOf<OpenedModel & { needs?: number }>(await this.send({ do: "open", bytes }));
      const { needs } = answer.json;
      if (needs === undefined) return { ...answer, start: bytes.byteLength };
      if (needs <= bytes.byteLength) throw new Error("the series ends too early");
      const rest = await bytesOf(source, [bytes.byteLength, needs]);
      if (rest.byteLength === 0) throw new Error("the series ends too early");
      bytes = await new Blob([bytes, rest]).arrayBuffer();
    }
  }

  /** Sends a query; `numbers` are transferred with it. */
  async ask<T>(question: EngineQuery, numbers?: ArrayBuffer): Promise<EngineResponse<T>> {
    return responseOf(await this.send({ do: "ask", question, numbers }, numbers ? [numbers] : []));
  }

  private send(message: Message, transfer: Transferable[] = []): Promise<WorkerResponse> {
    const id = this.next++;
    return new Promise((resolve, reject) => {
      const done = (r: WorkerResponse) => (r.error === undefined ? resolve(r) : reject(new Error(r.error)));
      this.waiting.set(id, { done, failed: reject });
      this.worker.postMessage({ ...message, id }, transfer);
    });
  }
}

const responseOf = <T>({ json, numbers, milliseconds }: WorkerResponse): EngineResponse<T> =>
  ({ json: json as T, numbers: numbers ?? new ArrayBuffer(0), milliseconds });

/** Bytes that are requested of a series at first. */
const SERIES_START = 16384;

/** The bytes of a source, or those from the first up to the second of a range; a server may send all of them. */
export async function bytesOf({ url, element }: Source, range?: [number, number]): Promise<ArrayBuffer> {
  if (url !== undefined) {
    const answer = await fetch(url, range && { headers: { Range: `bytes=${range[0]}-${range[1] - 1}` } });
    if (range && range[0] > 0 && answer.status === 200) return (await answer.arrayBuffer()).slice(...range);
    if (!answer.ok) throw new Error(`${url}: the server returned HTTP ${answer.status}`);
    return answer.arrayBuffer();
  }
  const node = document.getElementById(element ?? "");
  const text = node?.textContent ?? "";
  node?.remove();
  return decodeBase64(text);
}

function decodeBase64(base64: string): ArrayBuffer {
  const native = (Uint8Array as unknown as { fromBase64?: (text: string) => Uint8Array<ArrayBuffer> }).fromBase64;
  if (native) return native.call(Uint8Array, base64).buffer;
  const binary = atob(base64);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes.buffer;
}
