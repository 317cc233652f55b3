// A folder of 3D Tiles: levels come as the camera needs them, vertices quantised and packed by meshopt.
import { Box3, Matrix4, Sphere, Vector3 } from "three";
import { TilesRenderer } from "3d-tiles-renderer/three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { MeshoptDecoder } from "three/addons/libs/meshopt_decoder.module.js";
import { coloursOf, materialFor } from "./material.js";

// Attributes of an application begin with a line in glTF; the loader makes them lower case.
const ATTRIBUTES = ["synthetic", "uncertain", "deviation"];

/** Step of quantised positions in the tileset's units, 0 for floats. */
function stepOf(object) {
  const { array, normalized } = object.geometry.getAttribute("position");
  if (array instanceof Float32Array) return 0;
  const most = 2 ** (8 * array.BYTES_PER_ELEMENT - (/^Int/.test(array.constructor.name) ? 1 : 0)) - 1;
  return object.getWorldScale(new Vector3()).x * (normalized ? 1 / most : 1);
}

function dress(scene, found, steps) {
  scene.updateMatrixWorld(true);
  scene.traverse((object) => {
    if (!object.isMesh && !object.isPoints) return;
    const geometry = object.geometry;
    steps.finest = Math.min(steps.finest, stepOf(object));
    for (const name of ATTRIBUTES) {
      const values = geometry.getAttribute(`_${name}`);
      if (values) geometry.setAttribute(name, values).deleteAttribute(`_${name}`);
    }
    for (const name of coloursOf(geometry)) found.add(name);
    const picture = object.material.map;
    if (picture) found.add("rgb");
    object.material.dispose();
    object.material = materialFor(geometry, { linear: true, points: object.isPoints === true, picture });
  });
}

/** The library runs its queues once a frame, and a frame may take long: tiles then come one step a frame. */
function runAtOnce(queue) {
  let due = false;
  queue.scheduleJobRun = () => {
    if (due) return;
    due = true;
    setTimeout(() => {
      due = false;
      queue.tryRunJobs();
    });
  };
}

/**
 * \param url  of the tileset, beside the page
 * \param on   {loaded(), failed(message)}: a tile came; it did not
 * \returns a source like that of a mesh, with update(), and the matrix of its root
 */
export function openTiles(url, on) {
  const tiles = new TilesRenderer(url);
  for (const queue of [tiles.downloadQueue, tiles.parseQueue, tiles.processNodeQueue]) runAtOnce(queue);
  tiles.manager.addHandler(/\.(gltf|glb)$/, new GLTFLoader(tiles.manager).setMeshoptDecoder(MeshoptDecoder));
  tiles.errorTarget = 6;
  tiles.lruCache.minBytesSize = 256 * 2 ** 20;
  tiles.lruCache.maxBytesSize = 768 * 2 ** 20;
  const colours = new Set(), steps = { finest: Infinity };
  // The tile that is wanted first comes alone: processor and decoders are not shared with those that come after it.
  const jobs = tiles.downloadQueue.maxJobsPerOrigin;
  tiles.downloadQueue.maxJobsPerOrigin = 1;
  tiles.addEventListener("load-model", ({ scene }) => {
    tiles.downloadQueue.maxJobsPerOrigin = jobs;
    dress(scene, colours, steps);
    on.loaded();
  });
  for (const event of ["needs-update", "tile-visibility-change", "tiles-load-end", "dispose-model"])
    tiles.addEventListener(event, () => on.changed());
  tiles.addEventListener("load-error", () => (tiles.downloadQueue.maxJobsPerOrigin = jobs));
  tiles.addEventListener("load-error", ({ url: at, error }) => on.failed(`${decodeURI(String(at ?? url))}: ${error?.message ?? error}`));
  const opened = new Promise((done) => {
    const ready = () => {
      if (!tiles.root) return;
      tiles.removeEventListener("load-tileset", ready);
      const sphere = new Sphere(), box = new Box3(), placed = new Matrix4();
      tiles.getBoundingSphere(sphere);
      tiles.getOrientedBoundingBox(box, placed);
      done({ sphere, box, placed, root: tiles.root, asset: tiles.rootTileset.asset });
    };
    tiles.addEventListener("load-tileset", ready);
  });
  return { tiles, object: tiles.group, colours, steps, opened };
}
