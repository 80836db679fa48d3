// node draw.mjs MODULE MODEL PICTURES: draws MODEL with the WebAssembly module and compares with PICTURES.
import { readFileSync } from "node:fs";

const [module, model, native] = process.argv.slice(2).map((path) => readFileSync(path));
const { instance } = await WebAssembly.instantiate(module, {});
const { memory, room, pictures } = instance.exports;
const at = room(model.length);
new Uint8Array(memory.buffer, at, model.length).set(model);
const packed = BigInt.asUintN(64, pictures(at, model.length));
const drawn = Buffer.from(memory.buffer, Number(packed & 0xffffffffn), Number(packed >> 32n));
if (drawn[0] !== 1) {
    console.error(drawn.subarray(1).toString());
    process.exit(1);
}
const ours = drawn.subarray(1);
let differing = Math.abs(ours.length - native.length);
for (let i = 0; i < Math.min(ours.length, native.length); i++) differing += ours[i] === native[i] ? 0 : 1;
console.log(`${process.argv[3]}: ${ours.length} bytes of pictures, ${differing} differ`);
process.exit(differing === 0 ? 0 : 1);
