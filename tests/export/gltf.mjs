// Each glTF that is named, by Khronos' validator and by three.js: NAME.three gets what three.js makes of it, as JSON.
import { readFileSync, writeFileSync } from 'node:fs';
import validator from 'gltf-validator';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { GLTFGaussianSplatLoaderExtension } from 'three/addons/loaders/GLTFGaussianSplatLoaderExtension.js';

// What browsers have and Node has not.
globalThis.self ??= globalThis;
globalThis.ProgressEvent ??= class {};

// The validator is older than the extension: it knows neither its name nor those of its attributes.
const unknown = issue =>
    issue.code === 'UNSUPPORTED_EXTENSION' && issue.pointer === '/extensionsUsed/0' ||
    issue.code === 'MESH_PRIMITIVE_INVALID_ATTRIBUTE' && /\/attributes\/KHR_gaussian_splatting:/.test(issue.pointer);

for (const name of process.argv.slice(2)) {
    const bytes = readFileSync(name);
    const report = await validator.validateBytes(new Uint8Array(bytes), { maxIssues: 0 });
    const issues = report.issues.messages.filter(issue => !unknown(issue));
    if (issues.length > 0 || report.issues.truncated) {
        console.error(`${name}: ${JSON.stringify(issues, null, 2)}`);
        process.exit(1);
    }
    const loader = new GLTFLoader();
    loader.register(parser => new GLTFGaussianSplatLoaderExtension(parser));
    const content = name.endsWith('.glb') ? bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length) : bytes.toString();
    const loaded = await loader.parseAsync(content, '');
    const layers = [];
    loaded.scene.traverse(object => {
        const columns = object.splatGeometry?.attributes;
        if (columns !== undefined) {
            const list = key => Array.from(columns[key].array);
            layers.push({ name: object.name, position: list('position'), covariance: list('covariance'), color: list('color') });
        }
    });
    writeFileSync(`${name}.three`, JSON.stringify({ asset: loaded.asset, vertices: report.info.totalVertexCount, layers }));
}
