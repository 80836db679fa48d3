// The worker: runs the engine and answers one query after another.

import type { WorkerResponse, WorkerRequest } from "./protocol";

interface EngineExports {
  memory: WebAssembly.Memory;
  room(length: number): number;
  release(at: number, length: number): void;
  open(at: number, length: number): bigint;
  ask(at: number, length: number): bigint;
}

let engine: EngineExports | undefined;

/** Calls an entry point of the engine with bytes; returns its JSON and the numbers after it. */
function call(entry: "open" | "ask", bytes: Uint8Array): { json: unknown; numbers: ArrayBuffer } {
  if (!engine) throw new Error("the engine has not started");
  const at = engine.room(bytes.length);
  // `room` may have grown the memory, so its buffer is taken after.
  new Uint8Array(engine.memory.buffer, at, bytes.length).set(bytes);
  const packed = BigInt.asUintN(64, engine[entry](at, bytes.length));
  const [address, length] = [Number(packed & 0xffffffffn), Number(packed >> 32n)];
  const view = new DataView(engine.memory.buffer, address, length);
  const text = 4 + view.getUint32(0, true);
  const json = JSON.parse(new TextDecoder().decode(new Uint8Array(engine.memory.buffer, address + 4, text - 4)));
  const start = Math.min(length, Math.ceil(text / 8) * 8);
  const numbers = engine.memory.buffer.slice(address + start, address + length);
  engine.release(address, length);
  if (json !== null && typeof json === "object" && "error" in json) throw new Error(String(json.error));
  return { json, numbers };
}

/** The bytes of a query: its JSON, then its numbers. */
function queryBytes(question: string, numbers?: ArrayBuffer): Uint8Array {
  const json = new TextEncoder().encode(question);
  if (!numbers) return json;
  const bytes = new Uint8Array(json.length + numbers.byteLength);
  bytes.set(json);
  bytes.set(new Uint8Array(numbers), json.length);
  return bytes;
}

async function start(bytes: ArrayBuffer, gzip: boolean): Promise<void> {
  const stream = new Blob([bytes]).stream();
  const module = gzip ? await new Response(stream.pipeThrough(new DecompressionStream("gzip"))).arrayBuffer() : bytes;
  const { instance } = await WebAssembly.instantiate(module, {});
  engine = instance.exports as unknown as EngineExports;
}

self.onmessage = async ({ data }: MessageEvent<WorkerRequest>) => {
  const began = performance.now();
  const reply: WorkerResponse = { id: data.id, milliseconds: 0 };
  try {
    if (data.do === "start") {
      await start(data.engine, data.gzip);
    } else {
      const bytes = data.do === "open" ? new Uint8Array(data.bytes) : queryBytes(JSON.stringify(data.question), data.numbers);
      Object.assign(reply, call(data.do, bytes));
    }
  } catch (error) {
    // After a trap the instance still works for the next query.
    reply.error = error instanceof Error ? error.message : String(error);
  }
  reply.milliseconds = performance.now() - began;
  (self as unknown as Worker).postMessage(reply, reply.numbers ? [reply.numbers] : []);
};
