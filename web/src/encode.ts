// Encoders of exported files: PNG with texts, NPY, ZIP.

import type { Size } from "./protocol";

const TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let k = 0; k < 8; k++) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c;
});

/** CRC-32 of PNG and ZIP. */
export function crc32(bytes: Uint8Array): number {
  let c = 0xffffffff;
  for (const b of bytes) c = TABLE[(c ^ b) & 255] ^ (c >>> 8);
  return (c ^ 0xffffffff) >>> 0;
}

/** A PNG of a canvas with texts, as iTXt chunks after the header. */
export async function encodePng(canvas: OffscreenCanvas, texts: Record<string, string>): Promise<Uint8Array<ArrayBuffer>> {
  const bytes = new Uint8Array(await (await canvas.convertToBlob({ type: "image/png" })).arrayBuffer());
  // The signature and the header take 8 + 25 bytes.
  const chunks = Object.entries(texts).map(([key, text]) => chunk("iTXt", `${key}\0\0\0\0\0${text}`));
  const length = bytes.length + chunks.reduce((sum, c) => sum + c.length, 0);
  const out = new Uint8Array(length);
  out.set(bytes.subarray(0, 33));
  let at = 33;
  for (const c of chunks) {
    out.set(c, at);
    at += c.length;
  }
  out.set(bytes.subarray(33), at);
  return out;
}

function chunk(kind: string, text: string): Uint8Array {
  const data = new TextEncoder().encode(kind + text);
  const out = new Uint8Array(data.length + 8);
  const view = new DataView(out.buffer);
  view.setUint32(0, data.length - 4);
  out.set(data, 4);
  view.setUint32(data.length + 4, crc32(data));
  return out;
}

/** Pixels of a picture as a canvas. */
export function canvasOf(pixels: ArrayBuffer, size: Size): OffscreenCanvas {
  const canvas = new OffscreenCanvas(size.width, size.height);
  canvas.getContext("2d")!.putImageData(new ImageData(new Uint8ClampedArray(pixels), size.width, size.height), 0, 0);
  return canvas;
}

/** A plane of f32 as an NPY file (version 1.0, rows from the top). */
export function encodeNpy(values: ArrayBuffer, size: Size): BlobPart[] {
  const text = `{'descr': '<f4', 'fortran_order': False, 'shape': (${size.height}, ${size.width}), }`;
  const length = Math.ceil((10 + text.length + 1) / 64) * 64;
  const head = new Uint8Array(length).fill(32);
  head.set([0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59, 1, 0, (length - 10) & 255, (length - 10) >> 8]);
  head.set(new TextEncoder().encode(text), 10);
  head[length - 1] = 10;
  return [head, values];
}

/** A ZIP archive of uncompressed files. */
export function encodeZip(files: { name: string; bytes: Uint8Array<ArrayBuffer> }[]): BlobPart[] {
  const parts: BlobPart[] = [];
  const directory: Uint8Array<ArrayBuffer>[] = [];
  let offset = 0;
  for (const { name, bytes } of files) {
    const title = new TextEncoder().encode(name);
    const [crc, n] = [crc32(bytes), bytes.length];
    // Version 2.0, UTF-8 names, stored, 1980-01-01.
    const common = [[20, 2], [0x800, 2], [0, 2], [0, 2], [0x21, 2], [crc, 4], [n, 4], [n, 4], [title.length, 2], [0, 2]];
    const local = record([[0x04034b50, 4], ...common], title);
    directory.push(record([[0x02014b50, 4], [20, 2], ...common, [0, 2], [0, 2], [0, 2], [0, 4], [offset, 4]], title));
    parts.push(local, bytes);
    offset += local.length + n;
  }
  const size = directory.reduce((sum, d) => sum + d.length, 0);
  const count = files.length;
  const end = record([[0x06054b50, 4], [0, 2], [0, 2], [count, 2], [count, 2], [size, 4], [offset, 4], [0, 2]], new Uint8Array());
  return [...parts, ...directory, end];
}

/** Little-endian numbers of 2 or 4 bytes, then `tail`. */
function record(fields: number[][], tail: Uint8Array): Uint8Array<ArrayBuffer> {
  const length = fields.reduce((sum, [, width]) => sum + width, 0);
  const out = new Uint8Array(length + tail.length);
  const view = new DataView(out.buffer);
  let at = 0;
  for (const [value, width] of fields) {
    if (width === 2) view.setUint16(at, value, true);
    else view.setUint32(at, value, true);
    at += width;
  }
  out.set(tail, at);
  return out;
}
