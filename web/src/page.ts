// What the parts of the page share.

import type { EngineClient } from "./engine";
import type { Pane } from "./pane";
import type { Setup } from "./protocol";
import type { State } from "./state";

/** `layers` is the number of different layer names of all models. */
export interface Page {
  setup: Setup; remote: EngineClient; panes: Pane[]; layers: number; state: State; change(part: Partial<State>): void; say(text: string): void;
}
