// The WebGL2 renderer. It follows the stages of the CPU renderer: the engine projects Gaussians to strokes and assigns
// each to a plane of the pyramid; here strokes are added up in float planes, planes are summed from coarse to fine with
// the same eight taps, and one pass turns depths into colours. Nothing has to be sorted.

import { shaders } from "./shaders";
import type { PlaneColours, Size, StrokePlanes, ToneCurve } from "./protocol";

/** Quads per instance: much faster than one instance per quad. */
const QUADS = 128;
/** Strokes per row of their texture; each takes two texels. */
const ROW = 1024;

interface Plane { texture: WebGLTexture; target: WebGLFramebuffer; width: number; height: number }

/** Input of the tone pass, besides the depths. */
export interface ToneInput {
  paint: PlaneColours;
  strokes: StrokePlanes;
  /** For grey styles: the curve and its 1153 levels. */
  tone: { curve: ToneCurve; levels: Float32Array } | null;
  /** For density: 256 RGB triples. */
  colors: Uint8Array | null;
}

export class GlUnsupported extends Error {}

export class GlRenderer {
  readonly name: string;
  readonly software: boolean;
  /** Whether the planes hold half floats. */
  readonly half: boolean;
  private gl: WebGL2RenderingContext;
  private format: { internal: number; type: number };
  private programs: Record<keyof typeof shaders, Program>;
  private planes: Plane[] = [];
  private line: Plane | null = null;
  private levels: Plane | null = null;
  private strokes: WebGLTexture;
  private table: WebGLTexture;
  private colors: WebGLTexture;
  private empty: WebGLVertexArrayObject;

  constructor(private canvas: HTMLCanvasElement) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, preserveDrawingBuffer: true });
    if (!gl) throw new GlUnsupported("this browser has no WebGL2");
    this.gl = gl;
    const debug = gl.getExtension("WEBGL_debug_renderer_info");
    this.name = String(gl.getParameter(debug ? debug.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
    this.software = /swiftshader|llvmpipe|softpipe|software|basic render/i.test(this.name);
    if (!gl.getExtension("EXT_color_buffer_float")) throw new GlUnsupported("this GPU cannot draw into float32 textures");
    const full = gl.getExtension("EXT_float_blend") !== null;
    this.half = !full;
    this.format = full
      ? { internal: gl.R32F, type: gl.FLOAT }
      : { internal: gl.R16F, type: gl.HALF_FLOAT };
    this.programs = {} as Record<keyof typeof shaders, Program>;
    for (const name of Object.keys(shaders) as (keyof typeof shaders)[]) {
      this.programs[name] = new Program(gl, shaders[name].vertex, shaders[name].fragment);
    }
    this.strokes = this.texture();
    this.table = this.texture();
    this.colors = this.texture();
    this.empty = gl.createVertexArray()!;
    this.check();
  }

  /** Draws strokes into the canvas. */
  draw(numbers: ArrayBuffer, { paint, strokes, tone, colors }: ToneInput, size: Size): void {
    const { gl } = this;
    gl.bindVertexArray(this.empty);
    this.resize(strokes, size);
    this.upload(numbers);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE);
    strokes.planes.forEach((plane, i) => this.addStrokes(this.planes[i], plane.first, plane.count));
    for (let i = strokes.planes.length - 1; i > 0; i--) this.addUp(this.planes[i], this.planes[i - 1], strokes.pad);
    gl.disable(gl.BLEND);
    this.drawTones({ paint, strokes, tone, colors }, size);
    if (gl.getError() !== gl.NO_ERROR) throw new GlUnsupported("the GPU reported an error");
  }

  /** Grey levels or densities of the last picture, rows from the top. */
  values(): Float32Array {
    const { gl, levels } = this;
    if (!levels) return new Float32Array();
    this.bindTarget(levels);
    const all = new Float32Array(4 * levels.width * levels.height);
    gl.readPixels(0, 0, levels.width, levels.height, gl.RGBA, gl.FLOAT, all);
    return all.filter((_, i) => i % 4 === 0);
  }

  /** Waits until drawing has finished. */
  finish(): void {
    this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  private addStrokes(to: Plane, first: number, count: number): void {
    this.bindTarget(to);
    this.gl.clearColor(0, 0, 0, 0);
    this.gl.clear(this.gl.COLOR_BUFFER_BIT);
    if (count === 0) return;
    const program = this.use("strokes");
    this.bind(0, this.strokes, program.at("strokes"));
    this.gl.uniform2i(program.at("range"), first, count);
    this.gl.uniform2f(program.at("size"), to.width, to.height);
    this.gl.drawArraysInstanced(this.gl.TRIANGLES, 0, 6 * QUADS, Math.ceil(count / QUADS));
  }

  /** Upsamples a plane and adds it to the next finer one, vertically first. */
  private addUp(from: Plane, to: Plane, pad: number): void {
    const { gl } = this;
    this.line = this.sizedPlane(this.line, from.width, to.height);
    gl.disable(gl.BLEND);
    for (const [source, target, down] of [[from, this.line, 1], [this.line, to, 0]] as const) {
      if (!down) gl.enable(gl.BLEND);
      this.bindTarget(target);
      const program = this.use("upsample");
      this.bind(0, source.texture, program.at("coarse"));
      gl.uniform1i(program.at("down"), down);
      gl.uniform1i(program.at("pad"), pad);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
  }

  private drawTones({ paint, strokes, tone, colors }: ToneInput, size: Size): void {
    const { gl } = this;
    const perspective = strokes.perspective && paint.look !== null;
    const blurred = paint.look === "paraview";
    if (tone) this.store(this.table, gl.R32F, gl.RED, gl.FLOAT, tone.levels.length, tone.levels);
    if (colors) this.store(this.colors, gl.RGB8, gl.RGB, gl.UNSIGNED_BYTE, 256, colors);
    const mode = paint.look === null ? 3 : { paraview: 2, "paraview-no-fxaa": 1, expected: 0 }[paint.look];
    this.levels = this.sizedPlane(this.levels, size.width, size.height, true);
    this.bindTarget(this.levels);
    const level = this.use("level");
    this.bind(0, this.planes[0].texture, level.at("depths"));
    this.bind(1, this.table, level.at("table"));
    gl.uniform1i(level.at("pad"), strokes.pad);
    gl.uniform1i(level.at("mode"), mode);
    gl.uniform1i(level.at("perspective"), perspective ? 1 : 0);
    gl.uniform3f(level.at("lens"), strokes.center[0], strokes.center[1], strokes.focal);
    gl.uniform1fv(level.at("depths_of"), tone?.curve.depths ?? new Array(6).fill(0));
    gl.uniform1fv(level.at("ratios"), tone?.curve.ratios ?? new Array(6).fill(1));
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, size.width, size.height);
    const color = this.use("color");
    this.bind(0, this.levels.texture, color.at("levels"));
    this.bind(1, this.colors, color.at("colors"));
    gl.uniform1f(color.at("blur"), blurred ? (tone?.curve.blur ?? 0) : 0);
    gl.uniform1i(color.at("density"), mode === 3 ? 1 : 0);
    gl.uniform1i(color.at("white"), paint.white ? 1 : 0);
    gl.uniform1f(color.at("gain"), 2 ** paint.exposure);
    const [lo, hi] = paint.range ?? [1, 10];
    gl.uniform2f(color.at("range"), Math.log(lo), Math.log(hi / lo));
    gl.uniform2i(color.at("size"), size.width, size.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  private resize(strokes: StrokePlanes, size: Size): void {
    if (this.canvas.width !== size.width) this.canvas.width = size.width;
    if (this.canvas.height !== size.height) this.canvas.height = size.height;
    this.planes.slice(strokes.planes.length).forEach((p) => this.drop(p));
    this.planes = strokes.planes.map((p, i) =>
      this.sizedPlane(this.planes[i] ?? null, p.width + 2 * strokes.pad, p.height + 2 * strokes.pad));
  }

  private upload(numbers: ArrayBuffer): void {
    const { gl } = this;
    const texels = new Float32Array(numbers);
    const rows = Math.max(1, Math.ceil(texels.length / (8 * ROW)));
    if (rows > gl.getParameter(gl.MAX_TEXTURE_SIZE)) throw new GlUnsupported("this GPU's textures are too small for so many Gaussians");
    const whole = new Float32Array(8 * ROW * rows);
    whole.set(texels);
    gl.bindTexture(gl.TEXTURE_2D, this.strokes);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 2 * ROW, rows, 0, gl.RGBA, gl.FLOAT, whole);
  }

  private store(to: WebGLTexture, internal: number, format: number, type: number, width: number, data: ArrayBufferView): void {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, to);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, 1, 0, format, type, data);
  }

  private sizedPlane(plane: Plane | null, width: number, height: number, exact = false): Plane {
    if (plane && plane.width === width && plane.height === height) return plane;
    if (plane) this.drop(plane);
    const { gl } = this;
    const texture = this.texture();
    // Levels are not blended, so R32F works here even where blending needs half floats.
    const { internal, type } = exact ? { internal: gl.R32F, type: gl.FLOAT } : this.format;
    gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, gl.RED, type, null);
    const target = gl.createFramebuffer()!;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE) {
      throw new GlUnsupported("this GPU cannot draw into float32 textures");
    }
    return { texture, target, width, height };
  }

  /** Adds 1 twice to a plane and reads it back: some GPUs claim float blending but do not do it. */
  private check(): void {
    const { gl } = this;
    const probe = this.sizedPlane(null, 16, 16);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE);
    const one = new Float32Array(8 * ROW);
    one.set([8, 8, 0, -0.01, -0.01, -100, 1, 12]);
    one.set([8, 8, 0, -0.01, -0.01, -100, 1, 12], 8);
    this.upload(one.buffer);
    gl.bindVertexArray(this.empty);
    this.addStrokes(probe, 0, 2);
    const read = new Float32Array(4);
    gl.readPixels(8, 8, 1, 1, gl.RGBA, gl.FLOAT, read);
    this.drop(probe);
    gl.disable(gl.BLEND);
    if (Math.abs(read[0] - 2) > 0.02) throw new GlUnsupported("this GPU does not blend float32 correctly");
  }

  private bindTarget(plane: Plane): void {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, plane.target);
    this.gl.viewport(0, 0, plane.width, plane.height);
  }

  private use(name: keyof typeof shaders): Program {
    const program = this.programs[name];
    this.gl.useProgram(program.program);
    return program;
  }

  private bind(unit: number, texture: WebGLTexture, at: WebGLUniformLocation | null): void {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.uniform1i(at, unit);
  }

  private texture(): WebGLTexture {
    const { gl } = this;
    const texture = gl.createTexture()!;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const [key, value] of [
      [gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
    ]) gl.texParameteri(gl.TEXTURE_2D, key, value);
    return texture;
  }

  private drop(plane: Plane): void {
    this.gl.deleteFramebuffer(plane.target);
    this.gl.deleteTexture(plane.texture);
  }
}

class Program {
  readonly program: WebGLProgram;
  private places = new Map<string, WebGLUniformLocation | null>();

  constructor(private gl: WebGL2RenderingContext, vertex: string, fragment: string) {
    this.program = gl.createProgram()!;
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(kind)!;
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) {
      throw new GlUnsupported(`cannot compile a shader: ${gl.getProgramInfoLog(this.program)}`);
    }
  }

  at(name: string): WebGLUniformLocation | null {
    if (!this.places.has(name)) this.places.set(name, this.gl.getUniformLocation(this.program, name));
    return this.places.get(name)!;
  }
}
