// SPDX-License-Identifier: MIT
// Opens a page that holds the frame of a notebook, turns the model by dragging, and ends with 1 where a script fails or
// nothing is drawn.
//   node notebook.mjs PAGE NODE_MODULES BROWSER
import {createRequire} from 'node:module';

const [path, modules, browser] = process.argv.slice(2);
const {chromium} = createRequire(`${modules}/`)('playwright-core');
const instance = await chromium.launch({
  executablePath: browser,
  args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist']
});
const errors = [];
try {
  const page = await instance.newPage({viewport: {width: 1100, height: 700}});
  page.on('pageerror', (error) => errors.push(error.message));
  await page.goto(`file://${path}`);
  const element = await page.waitForSelector('iframe');
  const frame = await element.contentFrame();
  await frame.waitForFunction(() => document.getElementById('message')?.hidden ||
                              getComputedStyle(document.getElementById('message')).display === 'none', null, {timeout: 60000});
  const before = await element.screenshot();
  const box = await element.boundingBox();
  await page.mouse.move(box.x + 300, box.y + 300);
  await page.mouse.down();
  await page.mouse.move(box.x + 420, box.y + 330, {steps: 4});
  await page.mouse.up();
  await page.waitForTimeout(1000);  // longer than the page waits before it writes its address
  const after = await element.screenshot();
  if (before.equals(after)) errors.push('dragging changes no pixel');
  if (before.length < 20000) errors.push('the picture is empty');
} catch (error) {
  errors.push(error.message);
}
await instance.close();
errors.forEach((error) => console.error(error));
process.exit(errors.length > 0 ? 1 : 0);
