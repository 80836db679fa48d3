// Mouse, touch and keys.

import { panned, turned, zoomed, type Orbit } from "./camera";
import type { Size } from "./protocol";

export interface PointerInput {
  orbit(): Orbit;
  /** Called with the new orbit during a drag. */
  moved(orbit: Orbit): void;
  /** A click at CSS pixels of the element. */
  clicked(pixel: [number, number]): void;
  /** A double click. */
  centred(pixel: [number, number]): void;
}

const sizeOf = (element: HTMLElement): Size => ({ width: element.clientWidth, height: element.clientHeight });

/** Lets mouse and touch rotate, pan and zoom the picture in `element`. */
export function listenToPointer(element: HTMLElement, input: PointerInput): void {
  const fingers = new Map<number, [number, number]>();
  let travelled = 0;
  const at = (e: MouseEvent): [number, number] => {
    const box = element.getBoundingClientRect();
    return [e.clientX - box.left, e.clientY - box.top];
  };
  const middle = (): [number, number] => {
    const all = [...fingers.values()];
    return [0, 1].map((k) => all.reduce((s, p) => s + p[k], 0) / all.length) as [number, number];
  };
  const spread = (): number => {
    const [a, b] = [...fingers.values()];
    return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
  };
  element.addEventListener("pointerdown", (e) => {
    element.setPointerCapture(e.pointerId);
    fingers.set(e.pointerId, at(e));
    if (fingers.size === 1) travelled = 0;
  });
  element.addEventListener("pointermove", (e) => {
    const before = fingers.get(e.pointerId);
    if (!before) return;
    const [from, wide] = [middle(), spread()];
    fingers.set(e.pointerId, at(e));
    const to = middle();
    const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    travelled += Math.abs(dx) + Math.abs(dy);
    if (travelled < 3) return;
    const size = sizeOf(element);
    let orbit = input.orbit();
    if (fingers.size >= 2) {
      orbit = panned(orbit, dx, dy, size);
      const now = spread();
      if (wide > 0 && now > 0) orbit = zoomed(orbit, wide / now, to, size);
    } else if (e.shiftKey || e.ctrlKey || (e.buttons & 6) !== 0) {
      orbit = panned(orbit, dx, dy, size);
    } else {
      orbit = turned(orbit, dx, dy, size);
    }
    input.moved(orbit);
  });
  const lifted = (e: PointerEvent) => {
    const held = fingers.delete(e.pointerId);
    if (held && e.type === "pointerup" && travelled < 3 && fingers.size === 0 && e.button === 0) input.clicked(at(e));
  };
  element.addEventListener("pointerup", lifted);
  element.addEventListener("pointercancel", lifted);
  element.addEventListener("dblclick", (e) => input.centred(at(e)));
  element.addEventListener("contextmenu", (e) => e.preventDefault());
  element.addEventListener("wheel", (e) => {
    e.preventDefault();
    const lines = e.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1;
    input.moved(zoomed(input.orbit(), Math.exp(Math.max(-1, Math.min(1, e.deltaY * lines * 0.0015))), at(e), sizeOf(element)));
  }, { passive: false });
}

/** A key: its label and description in the list, and its action. */
export interface KeyBinding { keys: string[]; label: string; what: string; act: (event: KeyboardEvent) => void }

/** Handles keys everywhere except in text fields. */
export function listenToKeys(keys: KeyBinding[]): void {
  document.addEventListener("keydown", (event) => {
    // An open dialog gets all keys.
    if (event.defaultPrevented || document.querySelector("dialog[open]")) return;
    const target = event.target as HTMLElement;
    const moves = event.key.startsWith("Arrow") && target.matches("[type=range]");
    const presses = event.key === " " && target.matches("button, summary, [type=checkbox]");
    const typing = moves || presses || target.matches("input:not([type=checkbox], [type=radio], [type=range]), select, textarea, [role=separator]");
    if (event.metaKey || event.altKey || event.ctrlKey || (typing && event.key !== "Escape")) return;
    const key = keys.find((k) => k.keys.includes(event.key));
    if (!key) return;
    // Keeps space and arrow keys from scrolling.
    event.preventDefault();
    key.act(event);
  });
}
