// SPDX-License-Identifier: MIT
// A picture of a page of `skeletex view`.   node page.mjs NODE_MODULES PAGE HASH WIDTHxHEIGHT light|dark PICTURE
import {createRequire} from 'node:module';
import {join, resolve} from 'node:path';

const [modules, path, hash, size, colorScheme, picture] = process.argv.slice(2);
const {chromium} = createRequire(join(resolve(modules), 'x.js'))('playwright-core');
const browser = await chromium.launch({
  executablePath: '/usr/bin/chromium', args: ['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist', '--no-sandbox']
});
const [width, height] = size.split('x').map(Number);
const page = await browser.newPage({viewport: {width, height}, colorScheme});
await page.goto(`file://${resolve(path)}${hash}`);
await page.evaluate(() => globalThis.skeletex.then((shown) => shown.whole));
await page.mouse.move(0.3 * width, 0.4 * height);
await page.waitForTimeout(500);
await page.screenshot({path: picture});
await browser.close();
