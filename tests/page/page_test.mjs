// SPDX-License-Identifier: MIT
// The page of `skeletex view` in a browser: that it shows something, that every control changes it, and that its vertex
// shader puts vertices where the library does. Chromium draws in software.
//
//   node page_test.mjs PROGRAM SOURCE WORK NODE_MODULES BROWSER
// Ends with 77 where there is no browser, and with 1 and the reasons where something is wrong.
import {execFileSync} from 'node:child_process';
import {existsSync, mkdirSync, readFileSync, statSync, writeFileSync} from 'node:fs';
import {createServer} from 'node:http';
import {createRequire} from 'node:module';
import {join} from 'node:path';

const [program, source, work, modules, browserPath] = process.argv.slice(2);
if (!browserPath || !existsSync(browserPath)) {
  console.log('no Chromium: scripts/install-dependencies.sh installs it');
  process.exit(77);
}
if (!existsSync(join(modules, 'playwright-core'))) {
  console.error(`${modules} lacks playwright-core: the build without npm has no page to test; scripts/install-dependencies.sh installs npm`);
  process.exit(1);
}
const {chromium} = createRequire(join(modules, 'x.js'))('playwright-core');

let failures = 0;
function check(isGood, what) {
  if (isGood) return;
  ++failures;
  console.error(`FAILED: ${what}`);
}

const at = (name) => join(work, name);
const run = (...words) => execFileSync(program, words, {stdio: ['ignore', 'ignore', 'inherit']});

/** Vertices and triangles of a binary PLY file as the library writes it. */
function readPly(path) {
  const bytes = readFileSync(path), end = bytes.indexOf('end_header\n') + 11, header = bytes.toString('latin1', 0, end);
  const vertexCount = Number(/element vertex (\d+)/.exec(header)[1]), faceCount = Number(/element face (\d+)/.exec(header)[1]);
  const type = /property (float|double|float32|float64) x/.exec(header)[1], size = /double|64/.test(type) ? 8 : 4;
  const sizes = {char: 1, uchar: 1, short: 2, ushort: 2, int: 4, uint: 4, float: 4, float32: 4, double: 8, float64: 8};
  const properties = [...header.slice(0, header.indexOf('element face')).matchAll(/property (\w+) \w+/g)].map((match) => match[1]);
  const stride = properties.reduce((sum, name) => sum + sizes[name], 0);
  const positions = new Float64Array(3 * vertexCount), triangles = [];
  let offset = end;
  for (let i = 0; i < vertexCount; ++i, offset += stride)
    for (let k = 0; k < 3; ++k) positions[3 * i + k] = size === 8 ? bytes.readDoubleLE(offset + 8 * k) : bytes.readFloatLE(offset + 4 * k);
  for (let i = 0; i < faceCount; ++i, offset += 13) triangles.push([bytes.readInt32LE(offset + 1), bytes.readInt32LE(offset + 5), bytes.readInt32LE(offset + 9)]);
  return {positions, triangles};
}

/** What the page draws: points from the GPU, with the vertices of the library that they are. */
const drawn = (page) => page.evaluate(async () => {
  const {surface} = await globalThis.skeletex, {lattice} = surface, {origin} = surface.model;
  const {offset, scale} = surface.model.frame;  // to the user's units
  const points = Array.from(surface.positions(), (x, i) => offset[i % 3] + scale * (x + origin[i % 3]));
  const vertices = Array.from({length: lattice.vertexCount}, (_, i) => (i < lattice.innerCount ? i : lattice.innerCount + lattice.sources[i - lattice.innerCount]));
  return {points, vertices, triangles: Array.from(lattice.triangles), diagonal: scale * surface.model.diagonal};
});

/**
 * That every drawn point lies where the library's vertex does, that copies of a vertex are one point, and all occur.
 * @param {number} tolerance in diagonals @param {number} share of the vertices for which it holds; of the others, twenty times as much
 */
function compare(shown, ply, what, tolerance = 1e-4, share = 1) {
  const seen = new Map(), distances = [];
  let isOpen = false;
  shown.vertices.forEach((vertex, i) => {
    const own = shown.points.slice(3 * i, 3 * i + 3);
    distances.push(Math.hypot(...own.map((x, k) => x - ply.positions[3 * vertex + k])) / shown.diagonal);
    if (seen.has(vertex)) isOpen ||= seen.get(vertex).some((x, k) => x !== own[k]);
    else seen.set(vertex, own);
  });
  distances.sort((a, b) => a - b);
  const farthest = distances.at(-1), most = distances[Math.floor(share * (distances.length - 1))];
  console.log(`${what}: ${seen.size} vertices, farthest ${farthest.toExponential(2)} of the diagonal`);
  check(most <= tolerance && farthest <= (share === 1 ? 1 : 20) * tolerance, `${what}: a vertex lies ${farthest} diagonals off, ${share} of them up to ${most}`);
  check(!isOpen, `${what}: copies of a vertex lie apart`);
  check(seen.size === ply.positions.length / 3, `${what}: ${seen.size} of ${ply.positions.length / 3} vertices are drawn`);
}

/** That every edge of the drawn triangles has one triangle on either side. */
function checkClosed(shown, what) {
  const edges = new Map();
  for (let t = 0; t < shown.triangles.length; t += 3)
    for (let k = 0; k < 3; ++k) {
      const [a, b] = [shown.vertices[shown.triangles[t + k]], shown.vertices[shown.triangles[t + (k + 1) % 3]]];
      edges.set(`${a} ${b}`, (edges.get(`${a} ${b}`) ?? 0) + 1);
    }
  let open = 0;
  for (const [edge, count] of edges) open += count !== 1 || edges.get(edge.split(' ').reverse().join(' ')) !== 1;
  check(open === 0 && edges.size > 0, `${what}: ${open} edges are not shared by two triangles`);
}

/** The drawn triangles are the library's, whatever corner each begins with, but for a share of them. */
function checkTriangles(shown, ply, what, share = 0) {
  const key = ([a, b, c]) => (a < b && a < c ? [a, b, c] : b < c ? [b, c, a] : [c, a, b]).join(' ');
  const own = new Set();
  for (let t = 0; t < shown.triangles.length; t += 3) own.add(key([0, 1, 2].map((k) => shown.vertices[shown.triangles[t + k]])));
  const missing = ply.triangles.filter((triangle) => !own.has(key(triangle))).length;
  check(missing <= share * ply.triangles.length && own.size === ply.triangles.length, `${what}: ${missing} of ${ply.triangles.length} triangles are not the library's`);
}

const picture = (page) => page.evaluate(async () => {
  const page = await globalThis.skeletex;
  page.draw();
  const {gl} = page.picture, pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
  gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let hash = 0;
  const colours = new Set();
  for (let i = 0; i < pixels.length; i += 4) {
    const colour = pixels[i] << 16 | pixels[i + 1] << 8 | pixels[i + 2];
    hash = Math.imul(hash ^ colour, 16777619) | 0;
    if (colours.size < 1000) colours.add(colour);
  }
  return {hash, colours: colours.size, isLost: gl.isContextLost(), error: gl.getError()};
});

/** That what is done changes the picture. \return whether the page answered */
async function changes(page, what, act) {
  const before = await picture(page);
  await act();
  let after = await picture(page);
  for (let wait = 0; wait < 100 && after.hash === before.hash; ++wait) {  // a busy machine delivers events late
    await page.waitForTimeout(100);
    after = await picture(page);
  }
  check(before.hash !== after.hash, `${what} changes no pixel`);
  check(after.colours > 20, `${what}: the picture has ${after.colours} colours`);
  check(!after.isLost && after.error === 0, `${what}: the context is ${after.isLost ? 'lost' : `in error ${after.error}`}`);
}

async function open(browser, path, hash = '', options = {}) {
  const page = await browser.newPage({viewport: {width: 1000, height: 700}, ...options});
  const said = [];
  page.on('pageerror', (error) => said.push(error.message));
  page.on('console', (message) => ['error', 'warning'].includes(message.type()) && !/GPU stall|ReadPixels/.test(message.text()) && said.push(message.text()));
  page.on('request', (request) => !/^(file|data|blob):/.test(request.url()) && said.push(`asks for ${request.url()}`));
  await page.goto(`file://${path}${hash}`);
  await page.evaluate(() => globalThis.skeletex.then((shown) => shown.whole));
  page.said = said;
  return page;
}

const models = {bear: 'bear', man: 'man', homer: 'homer'};
mkdirSync(work, {recursive: true});
for (const name of Object.keys(models)) {
  const skeleton = join(source, 'configs/skeletons', `${name}.skeleton.json`);
  const mesh = join(source, 'build/meshes', JSON.parse(readFileSync(skeleton)).mesh);
  run('encode', mesh, skeleton, '-o', at(`${name}.skx.exr`), '--size', name === 'bear' ? '256' : '128');
}
run('view', at('bear.skx.exr'), '-o', at('bear.html'), '--against', join(source, 'build/meshes/bear.off'));
// At twice the size of the file, so that steps without residuals are tried, too.
// Two rings of bones and one between them.
const compact = {bear: join(source, 'build/meshes/bear.off'), eight_dumbbell: join(source, 'build/meshes/eight.off')};
for (const [name, mesh] of Object.entries(compact)) {
  run('encode', mesh, join(source, 'configs/skeletons', `${name}.skeleton.json`), '-o', at(`${name}.skx`), '--size', '128', '--max-error', '1e-3',
      '--front', name === 'bear' ? 'z' : '-x');
  run('view', at(`${name}.skx`), '-o', at(`${name}-compact.html`), '--size', '200');
}
run('view', at('man.skx.exr'), at('homer.skx.exr'), '-o', at('morph.html'));
check(statSync(at('bear.html')).size <= 1.5e6, `the page of 256 x 256 texels has ${statSync(at('bear.html')).size} bytes`);

const browser = await chromium.launch({
  executablePath: browserPath, args: ['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist', '--no-sandbox']
});

async function testPlaces() {
  const page = await open(browser, at('bear.html'));
  const first = await page.evaluate(async () => (await globalThis.skeletex).firstFrame);
  console.log(`first frame after ${Math.round(first)} ms`);  // told, not judged: other work on the machine counts, too
  check(first > 0, 'there was no first frame');
  run('reconstruct', at('bear.skx.exr'), '-o', at('bind.ply'), '--all-texels');
  const shown = await drawn(page), bind = readPly(at('bind.ply'), '--all-texels');
  compare(shown, bind, 'bind pose');
  checkTriangles(shown, bind, 'bind pose');
  checkClosed(shown, 'bind pose');

  for (const size of [128, 64, 32]) {
    run('reconstruct', at('bear.skx.exr'), '-o', at('level.ply'), '--all-texels', '--size', String(size));
    await page.evaluate(async (wanted) => {
      const page = await globalThis.skeletex;
      page.change({level: page.model.levels.findIndex((level) => level.width === wanted)});
    }, size);
    const level = await drawn(page);
    compare(level, readPly(at('level.ply')), `level of ${size}`);
    checkClosed(level, `level of ${size}`);
  }
  await page.evaluate(async () => (await globalThis.skeletex).change({level: 0}));

  // Joints dragged, and what the page saves as a pose read by the library.
  await page.evaluate(async () => {
    const page = await globalThis.skeletex, canvas = document.getElementById('overlay');
    page.draw();
    page.movable.forEach((isMovable, node) => {
      if (isMovable && node % 2) page.dragJoint(node, page.overlay.nodes[node][0] + 0.05 * canvas.clientHeight, page.overlay.nodes[node][1] - 0.09 * canvas.clientHeight);
    });
    page.turnJoint(page.movable.lastIndexOf(true), 2, 40);
  });
  writeFileSync(at('pose.json'), await page.evaluate(async () => (await globalThis.skeletex).poseJson()));
  run('reconstruct', at('bear.skx.exr'), '-o', at('posed.ply'), '--all-texels', '--pose', at('pose.json'));
  const posed = await drawn(page), moved = posed.points.reduce((most, x, i) => Math.max(most, Math.abs(x - shown.points[i])), 0);
  check(moved > 0.05 * posed.diagonal, `the pose moves vertices by ${moved / posed.diagonal} diagonals at most`);
  compare(posed, readPly(at('posed.ply')), 'pose');

  // The address brings the same back.
  await page.waitForFunction(() => /pose=/.test(location.hash), null, {timeout: 10000}).catch(() => check(false, 'the address does not say the pose'));
  const hash = await page.evaluate(() => location.hash);
  const again = await open(browser, at('bear.html'), hash);
  compare(await drawn(again), readPly(at('posed.ply')), 'pose from the address', 1.5e-4);
  check(page.said.length + again.said.length === 0, `the page says: ${[...page.said, ...again.said].join('; ')}`);
  await page.close();
  await again.close();
}

/** A page of a compact file decodes its texels itself, at every size. */
async function testCompact(name) {
  const path = at(`${name}-compact.html`), page = await open(browser, path);
  const sizes = await page.evaluate(async () => (await globalThis.skeletex).model.levels.map((level) => Math.max(level.width, level.height)));
  const seenFrom = await page.evaluate(async () => {
    const {orbit, picture} = await globalThis.skeletex, {x, y, z} = picture.camera.position;
    const [dx, dy, dz] = [x - orbit.target[0], y - orbit.target[1], z - orbit.target[2]], length = Math.hypot(dx, dy, dz);
    return [dx / length, dz / length];
  });
  check((name === 'bear' ? seenFrom[1] : -seenFrom[0]) > 0.8, `${name} is not seen from its front but from ${seenFrom}`);
  check(statSync(path).size <= 0.65e6, `the page of the compact file has ${statSync(path).size} bytes`);
  check(sizes.length >= 3, `the page of the compact file has ${sizes.length} levels`);
  for (const [level, size] of sizes.entries()) {
    run('unpack', at(`${name}.skx`), '-o', at('unpacked.skx.exr'), '--size', String(size));
    run('reconstruct', at('unpacked.skx.exr'), '-o', at('unpacked.ply'), '--all-texels');
    await page.evaluate(async (to) => (await globalThis.skeletex).change({level: to}), level);
    const shown = await drawn(page), ply = readPly(at('unpacked.ply'));
    compare(shown, ply, `compact ${name} at ${size}`, 1e-5);
    checkTriangles(shown, ply, `compact ${name} at ${size}`, 2e-3);  // diagonals that are as near
    checkClosed(shown, `compact ${name} at ${size}`);
  }
  // Bones that are in no cycle turn.
  const bind = await drawn(page);
  await page.evaluate(async () => {
    const page = await globalThis.skeletex;
    page.turnJoint(page.movable.lastIndexOf(true), 2, 40);
  });
  writeFileSync(at('pose.json'), await page.evaluate(async () => (await globalThis.skeletex).poseJson()));
  run('reconstruct', at('unpacked.skx.exr'), '-o', at('posed.ply'), '--all-texels', '--pose', at('pose.json'));
  const posed = await drawn(page), moved = posed.points.reduce((most, x, i) => Math.max(most, Math.abs(x - bind.points[i])), 0);
  check(moved > 0.05 * posed.diagonal, `the pose moves vertices by ${moved / posed.diagonal} diagonals at most`);
  compare(posed, readPly(at('posed.ply')), `compact ${name} in a pose`);
  check(page.said.length === 0, `the page says: ${page.said.join('; ')}`);
  await page.close();
}

/** A page shows its coarsest level while the rest is loaded, and says so where the rest is missing. */
async function testLoading() {
  const text = readFileSync(at('bear-compact.html'), 'latin1');
  let cut = -1;
  for (let part = 0; part < 3; ++part) cut = text.indexOf('<script>addPart(', cut + 1);  // behind the JSON and one level
  let sendRest;
  const server = createServer((_, answer) => {
    answer.writeHead(200, {'content-type': 'text/html'});
    answer.write(text.slice(0, cut), 'latin1');
    sendRest = () => answer.end(text.slice(cut), 'latin1');
  });
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
  const page = await browser.newPage({viewport: {width: 1000, height: 700}});
  await page.goto(`http://127.0.0.1:${server.address().port}/`, {waitUntil: 'commit'});
  await page.waitForFunction(() => document.getElementById('facts')?.textContent, null, {timeout: 20000});
  const sizes = await page.evaluate(async () => (await globalThis.skeletex).model.levels.map((level) => Math.max(level.width, level.height)));
  const matches = async (size, what) => {
    run('unpack', at('bear.skx'), '-o', at('unpacked.skx.exr'), '--size', String(size));
    run('reconstruct', at('unpacked.skx.exr'), '-o', at('unpacked.ply'), '--all-texels');
    compare(await drawn(page), readPly(at('unpacked.ply')), what, 1e-5);
    check((await picture(page)).colours > 20, `${what}: nothing is drawn`);
  };
  await matches(sizes.at(-1), 'while the page is loaded');
  sendRest();
  await page.evaluate(() => globalThis.skeletex.then((shown) => shown.whole));
  await matches(sizes[0], 'after the page is loaded');
  await page.close();
  server.close();

  writeFileSync(at('cut.html'), text.slice(0, cut + 1000), 'latin1');
  const part = await browser.newPage({viewport: {width: 1000, height: 700}});
  await part.goto(`file://${at('cut.html')}`);
  const isSaid = await part.waitForFunction(() => /end is missing/.test(document.getElementById('message').textContent), null, {timeout: 10000}).catch(() => false);
  check(isSaid && await part.isVisible('#message'), 'a page without its end does not say so');
  check((await picture(part)).colours > 20, 'a page without its end shows nothing');
  await part.close();
}

async function testMorph() {
  const page = await open(browser, at('morph.html'));
  for (const t of [0, 0.25, 0.4375, 0.4, 1]) {
    run('morph', at('man.skx.exr'), at('homer.skx.exr'), '--t', String(t), '--layout', '1', '--creases', '--regular-grid', '-o', at('morph.ply'));
    await page.evaluate(async (to) => (await globalThis.skeletex).change({t: to}), t);
    const shown = await drawn(page);
    // Exact at its keys, multiples of a sixteenth; between them but for columns at corners.
    compare(shown, readPly(at('morph.ply')), `morph at ${t}`, 1e-4, Number.isInteger(16 * t) ? 1 : 0.98);
    checkClosed(shown, `morph at ${t}`);
  }
  run('morph', at('man.skx.exr'), at('homer.skx.exr'), '--t', '0', '--layout', '1', '--creases', '--regular-grid', '-o', at('target.skx.exr'));
  run('transfer', at('homer.skx.exr'), at('target.skx.exr'), '--bones', 'head=head', '-o', at('transfer.ply'));
  await page.evaluate(async () => {
    const page = await globalThis.skeletex;
    page.change({t: 0});
    page.toggleTransfer(page.model.skeleton.bones.findIndex((bone) => bone.name === 'head'));
  });
  compare(await drawn(page), readPly(at('transfer.ply')), 'transfer');
  check(page.said.length === 0, `the page says: ${page.said.join('; ')}`);
  await page.close();
}

async function testControls() {
  const page = await open(browser, at('bear.html'));
  const box = await page.locator('#picture').boundingBox(), middle = [box.x + box.width / 2, box.y + box.height / 2];
  for (const mode of ['segments', 'checker', 'error', 'normals', 'shaded']) await changes(page, mode, () => page.click(`#mode-${mode}`));
  await changes(page, 'dragging', async () => {
    await page.mouse.move(box.x + 40, box.y + 300);
    await page.mouse.down();
    await page.mouse.move(box.x + 140, box.y + 340, {steps: 4});
    await page.mouse.up();
  });
  await changes(page, 'the wheel', () => page.mouse.wheel(0, -300));
  await changes(page, 'an arrow key', () => page.keyboard.press('ArrowLeft'));
  await changes(page, 'the key 2', () => page.keyboard.press('2'));
  await changes(page, 'Reset view', () => page.click('#home'));
  await changes(page, 'level of detail', () => page.locator('#level').fill('0'));
  await changes(page, 'dragging a joint', async () => {
    const [x, y] = await page.evaluate(async () => {
      const page = await globalThis.skeletex;
      return page.overlay.nodes[page.movable.lastIndexOf(true)];
    });
    await page.mouse.move(box.x + x, box.y + y);
    await page.mouse.down();
    await page.mouse.move(box.x + x + 60, box.y + y - 60, {steps: 4});
    await page.mouse.up();
  });
  await changes(page, 'Reset of the pose', () => page.click('#unpose'));
  await changes(page, 'Up', () => page.click('#up'));
  await page.click('#up');
  await page.mouse.move(...middle);
  const hasText = await page.waitForFunction(() => document.getElementById('texel').textContent !== '', null, {timeout: 10000}).catch(() => false);
  check(hasText, 'pointing at the surface shows no texel');
  const map = await page.locator('#texture').boundingBox();
  await page.mouse.move(map.x + 0.3 * map.width, map.y + 0.3 * map.height);
  const hasPoint = await page.waitForFunction(async () => (await globalThis.skeletex).marked?.point.every(Number.isFinite), null, {timeout: 10000}).catch(() => false);
  check(hasPoint, 'pointing at the texture shows no point');
  const [download] = await Promise.all([page.waitForEvent('download'), page.click('#save')]);
  const file = await download.path();
  check(readFileSync(file).subarray(1, 4).toString() === 'PNG', 'the saved picture is no PNG');
  await changes(page, 'a dark system', () => page.emulateMedia({colorScheme: 'dark'}));
  check(page.said.length === 0, `the page says: ${page.said.join('; ')}`);
  await page.close();

  const second = await open(browser, at('morph.html'), '#t=0.3', {hasTouch: true, viewport: {width: 390, height: 780}});
  check(await second.evaluate(async () => (await globalThis.skeletex).shown.t) === 0.3, 'the address does not set t');
  await changes(second, 'the morph', () => second.locator('#t').fill('0.8'));
  await changes(second, 'a transfer', () => second.locator('#bones button:not(:disabled)').first().click());
  await changes(second, 'a touch that drags', () => second.evaluate(() => {
    const canvas = document.getElementById('picture');
    const send = (type, x, y) => canvas.dispatchEvent(new PointerEvent(type, {pointerId: 5, pointerType: 'touch', clientX: x, clientY: y, bubbles: true}));
    canvas.setPointerCapture = () => {};
    send('pointerdown', 12, 200);
    send('pointermove', 80, 230);
    send('pointerup', 80, 230);
  }));
  const wide = await second.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  check(wide <= 0, `on a phone the page is ${wide} pixels too wide`);
  check(second.said.length === 0, `the page says: ${second.said.join('; ')}`);
  await second.close();
}

try {
  await testPlaces();
  for (const name of Object.keys(compact)) await testCompact(name);
  await testLoading();
  await testMorph();
  await testControls();
} catch (error) {
  check(false, error.stack);
} finally {
  await browser.close();
}
process.exit(failures > 0 ? 1 : 0);
