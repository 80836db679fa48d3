// Dialogs: forms, messages and the list of keys.

import { h } from "./dom";
import type { KeyBinding } from "./input";

/** Shows a form; resolves to it when the user accepts, to `null` otherwise. */
export function askForm(title: string, accept: string, ...fields: HTMLElement[]): Promise<HTMLFormElement | null> {
  const form = h("form", { method: "dialog" },
    h("h2", { text: title }), ...fields,
    h("div", { class: "buttons" },
      h("button", { value: "yes", text: accept }),
      h("button", { value: "no", text: "Cancel", type: "button", click: () => dialog.close() })));
  const dialog = h("dialog", { "aria-label": title }, form);
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(dialog.returnValue === "yes" ? form : null);
    });
  });
}

/** Shows a message until it is closed. */
export function showMessage(title: string, ...content: HTMLElement[]): void {
  const close = h("button", { text: "Close", value: "no" });
  const dialog = h("dialog", { "aria-label": title },
    h("form", { method: "dialog" }, h("h2", { text: title, tabindex: "-1", autofocus: true }), ...content, h("div", { class: "buttons" }, close)));
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

/** A labelled field of a form. */
export function field(label: string, input: HTMLElement): HTMLElement {
  return h("label", { class: "row" }, label, input);
}

/** Lists all mouse actions and keys. */
export function showKeys(keys: KeyBinding[]): void {
  const mouse: [string, string][] = [
    ["drag", "rotate"], ["Shift drag, right drag, two fingers", "pan"], ["wheel, pinch", "zoom to the pointer"],
    ["click", "show the values at this point"], ["double click", "centre the view on this point"],
  ];
  const rows = [...mouse, ...keys.map((k): [string, string] => [k.label, k.what])];
  const table = h("table", {}, ...rows.map(([key, what]) => h("tr", {}, h("th", { text: key, scope: "row" }), h("td", { text: what }))));
  showMessage("Mouse, touch and keys", table);
}
