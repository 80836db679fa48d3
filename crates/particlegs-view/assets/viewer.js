"use strict";
// Names the models and checks that their bytes and the engine's arrive.
(async () => {
  const setup = JSON.parse(document.getElementById("setup").textContent);
  const app = document.getElementById("app");
  const bytesOf = async (place) => {
    if (place.url) {
      const answer = await fetch(place.url);
      if (!answer.ok) throw new Error(await answer.text());
      return (await answer.arrayBuffer()).byteLength;
    }
    return atob(document.getElementById(place.element).textContent).length;
  };
  const say = (text) => {
    const line = document.createElement("p");
    line.textContent = text;
    app.append(line);
  };
  try {
    for (const model of setup.models) say(`${model.name}: ${await bytesOf(model)} of ${model.bytes} bytes`);
    say(`engine: ${await bytesOf(setup.engine)} bytes`);
    if (setup.truth) say(`${setup.truth.name}: ${setup.truth.particles} particles`);
    const source = document.getElementById("worker").textContent;
    const worker = new Worker(URL.createObjectURL(new Blob([source], { type: "text/javascript" })));
    worker.onmessage = (answer) => say(`worker: ${answer.data}`);
    worker.postMessage("ready");
  } catch (fault) {
    say(`error: ${fault.message}`);
  }
})();
