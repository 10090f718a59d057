// What the page of kineme.robots.view takes from three.js and urdf-loader, as one global name: scene.
export {
  BufferGeometry, Color, DirectionalLight, Float32BufferAttribute, GridHelper, HemisphereLight, LoadingManager, Mesh,
  MeshBasicMaterial, MeshPhongMaterial, OctahedronGeometry, PerspectiveCamera, Scene, SphereGeometry, Spherical, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
export { ColladaLoader } from "three/examples/jsm/loaders/ColladaLoader.js";
export { STLLoader } from "three/examples/jsm/loaders/STLLoader.js";
export { default as URDFLoader } from "urdf-loader";
