(function () {
  "use strict";
  var root = document.currentScript.parentElement;
  var data = JSON.parse(root.querySelector('script[type="application/json"]').textContent);
  var canvas = root.querySelector(".main"), out = root.querySelector("output");
  var gl = canvas.getContext("webgl", { antialias: true });
  if (!gl || !gl.getExtension("OES_element_index_uint")) {
    canvas.style.display = "none";
    out.textContent = "This browser does not offer WebGL; see the still picture.";
    return;
  }
  function bytes(text) {
    var raw = atob(text), array = new Uint8Array(raw.length);
    for (var i = 0; i < raw.length; i++) array[i] = raw.charCodeAt(i);
    return array.buffer;
  }
  var pos = new Uint16Array(bytes(data.positions)), tee = new Uint16Array(bytes(data.t));
  var colors = new Uint8Array(bytes(data.colors)), groups = {};
  ["inner", "outer", "lamps"].forEach(function (g) { groups[g] = new Uint32Array(bytes(data.groups[g])); });
  var linePos = new Uint16Array(bytes(data.lines)), lineNormal = new Int8Array(bytes(data.line_normals));

  function shader(type, source) {
    var s = gl.createShader(type); gl.shaderSource(s, source); gl.compileShader(s); return s;
  }
  function program(vertex, fragment) {
    var p = gl.createProgram();
    gl.attachShader(p, shader(gl.VERTEX_SHADER, vertex));
    gl.attachShader(p, shader(gl.FRAGMENT_SHADER, fragment));
    gl.linkProgram(p);
    return p;
  }
  var head = "uniform mat4 m; uniform vec3 low; uniform vec3 span; uniform vec3 eye; attribute vec3 a;";
  var surface = program(
    head + "attribute float t; varying float v; void main(){ v=t; gl_Position=m*vec4(low+span*a,1.0); }",
    "precision mediump float; varying float v; uniform sampler2D table; uniform float lamp;" +
    "void main(){ gl_FragColor = lamp>0.5 ? vec4(1.0,0.98,0.886,1.0) : texture2D(table, vec2(v*0.99609+0.00195,0.5)); }");
  // Lines of surfaces that look away go outside the clip volume; the others come a little forward.
  var wire = program(
    head + "attribute vec3 n; void main(){ vec3 p=low+span*a; float f=dot(n,eye-p);" +
    "gl_Position = f>0.0 ? m*vec4(mix(p,eye,0.002),1.0) : vec4(2.0,2.0,2.0,1.0); }",
    "precision mediump float; void main(){ gl_FragColor=vec4(0.11,0.145,0.19,1.0); }");
  function buffer(target, array) {
    var b = gl.createBuffer(); gl.bindBuffer(target, b); gl.bufferData(target, array, gl.STATIC_DRAW); return b;
  }
  var posBuffer = buffer(gl.ARRAY_BUFFER, pos), teeBuffer = buffer(gl.ARRAY_BUFFER, tee);
  var lineBuffer = buffer(gl.ARRAY_BUFFER, linePos), normalBuffer = buffer(gl.ARRAY_BUFFER, lineNormal);
  var index = {};
  Object.keys(groups).forEach(function (g) { index[g] = buffer(gl.ELEMENT_ARRAY_BUFFER, groups[g]); });
  var texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, colors);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);

  var ramp = root.querySelector(".ramp"), paint = ramp.getContext("2d");
  for (var i = 0; i < 256; i++) {
    paint.fillStyle = "rgb(" + colors[3 * i] + "," + colors[3 * i + 1] + "," + colors[3 * i + 2] + ")";
    paint.fillRect(0, 255 - i, 1, 1);
  }
  data.labels.forEach(function (label, k) {
    var tick = document.createElement("span");
    tick.textContent = label;
    tick.style.bottom = 100 * k / (data.labels.length - 1) + "%";
    root.querySelector(".ticks").appendChild(tick);
  });

  function sub(a, b) { return [a[0] - b[0], a[1] - b[1], a[2] - b[2]]; }
  function dot(a, b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
  function cross(a, b) { return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]; }
  function unit(a) { var l = Math.sqrt(dot(a, a)); return [a[0] / l, a[1] / l, a[2] / l]; }
  var target = data.target.slice(), offset = sub(data.eye, target);
  var size = Math.sqrt(dot(data.span, data.span));
  var distance = Math.sqrt(dot(offset, offset));
  var azimuth = Math.atan2(offset[1], offset[0]), altitude = Math.asin(offset[2] / distance);
  var inside = root.querySelector(".inside input"), state = null;
  if (!data.interior) root.querySelector(".inside").style.display = "none";

  function camera() {
    var c = Math.cos(altitude);
    var out = [c * Math.cos(azimuth), c * Math.sin(azimuth), Math.sin(altitude)];
    var eye = [target[0] + distance * out[0], target[1] + distance * out[1], target[2] + distance * out[2]];
    var forward = [-out[0], -out[1], -out[2]], right = unit(cross(forward, [0, 0, 1]));
    return { eye: eye, forward: forward, right: right, up: cross(right, forward),
      tan: Math.tan(data.fov * Math.PI / 360), aspect: canvas.width / canvas.height };
  }
  function matrix(c) {
    var near = Math.max(distance - size, distance * 0.01), far = distance + size;
    var f = 1 / c.tan, a = (far + near) / (near - far), b = 2 * far * near / (near - far);
    var r = c.right, u = c.up, w = c.forward, e = c.eye, q = f / c.aspect;
    return new Float32Array([
      q * r[0], f * u[0], -a * w[0], w[0], q * r[1], f * u[1], -a * w[1], w[1],
      q * r[2], f * u[2], -a * w[2], w[2], -q * dot(r, e), -f * dot(u, e), a * dot(w, e) + b, -dot(w, e)]);
  }
  function attribute(p, name, b, n, type) {
    var at = gl.getAttribLocation(p, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, b);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, n, type, true, 0, 0);
  }
  function uniforms(p, m, c) {
    gl.useProgram(p);
    gl.uniformMatrix4fv(gl.getUniformLocation(p, "m"), false, m);
    gl.uniform3fv(gl.getUniformLocation(p, "low"), data.low);
    gl.uniform3fv(gl.getUniformLocation(p, "span"), data.span);
    gl.uniform3fv(gl.getUniformLocation(p, "eye"), c.eye);
  }
  function draw() {
    state = null;
    var scale = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * scale);
    canvas.height = Math.round(canvas.clientHeight * scale);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    var c = camera(), m = matrix(c);
    uniforms(surface, m, c);
    attribute(surface, "a", posBuffer, 3, gl.UNSIGNED_SHORT);
    attribute(surface, "t", teeBuffer, 1, gl.UNSIGNED_SHORT);
    visible().forEach(function (g) {
      gl.uniform1f(gl.getUniformLocation(surface, "lamp"), g === "lamps" ? 1 : 0);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, index[g]);
      gl.drawElements(gl.TRIANGLES, groups[g].length, gl.UNSIGNED_INT, 0);
    });
    uniforms(wire, m, c);
    attribute(wire, "a", lineBuffer, 3, gl.UNSIGNED_SHORT);
    attribute(wire, "n", normalBuffer, 3, gl.BYTE);
    gl.drawArrays(gl.LINES, 0, inside.checked ? data.inner_line_vertices : linePos.length / 3);
  }
  function redraw() { if (state === null) { state = requestAnimationFrame(draw); } }
  function visible() { return inside.checked ? ["inner", "lamps"] : ["inner", "outer", "lamps"]; }

  function vertex(i) {
    return [data.low[0] + data.span[0] * pos[3 * i] / 65535, data.low[1] + data.span[1] * pos[3 * i + 1] / 65535,
      data.low[2] + data.span[2] * pos[3 * i + 2] / 65535];
  }
  function read(x, y) {
    var c = camera(), box = canvas.getBoundingClientRect();
    var sx = (2 * (x - box.left) / box.width - 1) * c.tan * c.aspect, sy = (1 - 2 * (y - box.top) / box.height) * c.tan;
    var d = [0, 1, 2].map(function (k) { return c.forward[k] + sx * c.right[k] + sy * c.up[k]; });
    var best = Infinity, found = null;
    visible().forEach(function (g) {
      var list = groups[g];
      for (var i = 0; i < list.length; i += 3) {
        var a = vertex(list[i]), e1 = sub(vertex(list[i + 1]), a), e2 = sub(vertex(list[i + 2]), a);
        var p = cross(d, e2), det = dot(e1, p);
        if (det <= 0) continue;
        var s = sub(c.eye, a), u = dot(s, p) / det;
        if (u < 0 || u > 1) continue;
        var q = cross(s, e1), v = dot(d, q) / det, t = dot(e2, q) / det;
        if (v >= 0 && u + v <= 1 && t > 0 && t < best) {
          best = t;
          found = { i: list[i], t: ((1 - u - v) * tee[list[i]] + u * tee[list[i + 1]] + v * tee[list[i + 2]]) / 65535 };
        }
      }
    });
    if (!found) { out.textContent = ""; return; }
    var n = data.levels.length - 1, place = found.t * n, k = Math.min(Math.floor(place), n - 1);
    var lux = data.levels[k] + (place - k) * (data.levels[k + 1] - data.levels[k]);
    var limit = found.t <= 0 ? "≤ " : found.t >= 1 ? "≥ " : "";
    out.textContent = data.names[data.parts[Math.floor(found.i / data.per_element)]] + ": " + limit + Number(lux.toPrecision(3)) + " lx";
  }

  var drag = null, waiting = false;
  canvas.addEventListener("pointerdown", function (e) {
    drag = { x: e.clientX, y: e.clientY, move: e.button === 2 || e.shiftKey };
    canvas.setPointerCapture(e.pointerId);
  });
  canvas.addEventListener("pointerup", function () { drag = null; });
  canvas.addEventListener("contextmenu", function (e) { e.preventDefault(); });
  canvas.addEventListener("pointermove", function (e) {
    if (!drag) {
      if (!waiting) {
        waiting = true;
        setTimeout(function () { waiting = false; read(e.clientX, e.clientY); }, 60);
      }
      return;
    }
    var dx = e.clientX - drag.x, dy = e.clientY - drag.y;
    drag.x = e.clientX; drag.y = e.clientY;
    if (drag.move) {
      var c = camera(), f = 2 * c.tan * distance / canvas.clientHeight;
      for (var k = 0; k < 3; k++) target[k] += f * (dy * c.up[k] - dx * c.right[k]);
    } else {
      azimuth -= 0.008 * dx;
      altitude = Math.max(-1.5, Math.min(1.5, altitude + 0.008 * dy));
    }
    redraw();
  });
  canvas.addEventListener("wheel", function (e) {
    e.preventDefault();
    distance = Math.max(0.02 * size, Math.min(20 * size, distance * Math.exp(0.001 * e.deltaY)));
    redraw();
  }, { passive: false });
  inside.addEventListener("change", redraw);
  window.addEventListener("resize", redraw);
  draw();
})();
