"use strict";
self.onmessage = (asked) => self.postMessage(asked.data);
