// The meshes of the scene: shaded triangles and their edges by WebGL 2, edges alone on a plain canvas without it.
const VERTEX = `#version 300 es
uniform mat4 clip; uniform mat4 model; in vec3 position; out vec3 at;
void main() { vec4 p = model * vec4(position, 1.0); at = p.xyz; gl_Position = clip * p; }`;
const FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 colour; uniform float lit; in vec3 at; out vec4 result;
void main() {
  vec3 n = normalize(cross(dFdx(at), dFdy(at)));
  float light = mix(1.0, 0.62 + 0.38 * abs(dot(n, normalize(vec3(-0.45, 0.35, 0.82)))), lit);
  result = vec4(colour.rgb * light * colour.a, colour.a);
}`;
// Meshes with more edges get fainter ones: drawn in full, they would cover the surfaces.
const FEW_EDGES = 300;
let gpu = null;

function openGpu() {
  const canvas = byId("scene-mesh");
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true, alpha: true });
  if (!gl) return { gl: null };
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return { gl: null };
  const place = Object.fromEntries(["clip", "model", "colour", "lit"].map((n) => [n, gl.getUniformLocation(program, n)]));
  const position = gl.getAttribLocation(program, "position");
  const buffer = (target, data) => {
    const made = gl.createBuffer();
    gl.bindBuffer(target, made);
    gl.bufferData(target, data, gl.STATIC_DRAW);
    return made;
  };
  const meshes = about.meshes.map((mesh, k) => {
    const edges = array(`m${k}.edges`).data;
    return {
      ...mesh,
      vertices: buffer(gl.ARRAY_BUFFER, array(`m${k}.vertices`).data),
      faces: buffer(gl.ELEMENT_ARRAY_BUFFER, array(`m${k}.faces`).data),
      edges: buffer(gl.ELEMENT_ARRAY_BUFFER, edges),
      edgeCount: edges.length,
    };
  });
  return { gl, program, place, position, meshes };
}

const poseOf = (radar, row, frame) => {
  const poses = array(`${radar.prefix}.poses`);
  const from = (row * poses.shape[1] + frame) * 12;
  return poses.data.subarray(from, from + 12);
};
const eyeOf = (radar, frame) => array(`${radar.prefix}.radar`).data.subarray(frame * 15, frame * 15 + 12);

// From the frame of a link of a body to that of the radar.
function modelMatrix(radar, body, link, frame) {
  return multiply(inverseRigid(eyeOf(radar, frame)), rigid(poseOf(radar, body.pose + link, frame)));
}

function sizeLike(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  return ratio;
}

const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);

function paintMeshes(clip) {
  const canvas = byId("scene-mesh");
  if (!gpu) gpu = openGpu();
  const ratio = sizeLike(canvas);
  const radar = radarNow();
  if (!gpu.gl) {
    paintEdges(canvas, clip, radar, ratio);
    return;
  }
  const { gl, program, place, position, meshes } = gpu;
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.POLYGON_OFFSET_FILL);
  gl.polygonOffset(1.5, 1.5);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.useProgram(program);
  gl.uniformMatrix4fv(place.clip, false, new Float32Array(clip));
  gl.enableVertexAttribArray(position);
  const edge = rgb(darkNow() ? "#6d7f90" : "#7b8794");
  for (const body of radar.bodies) {
    const mesh = meshes[body.mesh];
    const moveTo = (link) => gl.uniformMatrix4fv(place.model, false, new Float32Array(modelMatrix(radar, body, link, state.frame)));
    gl.bindBuffer(gl.ARRAY_BUFFER, mesh.vertices);
    gl.vertexAttribPointer(position, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.faces);
    gl.uniform1f(place.lit, 1);
    const chosen = body.id > 0 && body.id === state.object;
    for (const [link, tag, first, count] of mesh.runs) {
      moveTo(link);
      const own = surfaceColour(tag);
      const tint = chosen ? rgb(objectColour(radar, body.id)).map((v, i) => 0.45 * v + 0.55 * own[i]) : own;
      gl.uniform4f(place.colour, ...tint, 1);
      gl.drawElements(gl.TRIANGLES, 3 * count, gl.UNSIGNED_INT, 12 * first);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.edges);
    gl.uniform1f(place.lit, 0);
    gl.uniform4f(place.colour, ...edge, Math.min(1, Math.max(0.18, 2 * FEW_EDGES / (mesh.edgeCount + 1))));
    for (const [link, first, count] of mesh.edge_runs) {
      moveTo(link);
      gl.drawElements(gl.LINES, 2 * count, gl.UNSIGNED_INT, 8 * first);
    }
  }
}

// Without WebGL: every edge, near the picture or not; hidden ones too.
function paintEdges(canvas, clip, radar, ratio) {
  const ctx = canvas.getContext("2d");
  const w = canvas.clientWidth, h = canvas.clientHeight;
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.clearRect(0, 0, w, h);
  ctx.lineWidth = 0.8;
  for (const body of radar.bodies) {
    const v = array(`m${body.mesh}.vertices`).data, e = array(`m${body.mesh}.edges`).data;
    const chosen = body.id > 0 && body.id === state.object;
    ctx.strokeStyle = chosen ? objectColour(radar, body.id) : darkNow() ? "#5d6f80" : "#8b97a4";
    ctx.beginPath();
    for (const [link, first, count] of about.meshes[body.mesh].edge_runs) {
      const m = multiply(clip, modelMatrix(radar, body, link, state.frame));
      const at = (k) => projected(m, w, h, v[3 * e[k]], v[3 * e[k] + 1], v[3 * e[k] + 2]);
      for (let i = 2 * first; i < 2 * (first + count); i += 2) {
        const p = at(i), q = at(i + 1);
        if (!p || !q) continue;
        ctx.moveTo(p[0], p[1]);
        ctx.lineTo(q[0], q[1]);
      }
    }
    ctx.stroke();
  }
}
