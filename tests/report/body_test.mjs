// Opens the report of a body in a far field in a browser and checks that the body is seen: the
// view shows it, not the far field: node body_test.mjs REPORT.html BROWSER

import assert from 'node:assert/strict';
import { pathToFileURL } from 'node:url';
import puppeteer from 'puppeteer-core';

const [file, browserPath] = process.argv.slice(2);
// The caller limits the time: on a busy machine every step may take long.
const browser = await puppeteer.launch({
  executablePath: browserPath, timeout: 0, protocolTimeout: 0,
  args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});

try {
  const page = await browser.newPage();
  page.setDefaultTimeout(0);
  await page.goto(pathToFileURL(file).href, { waitUntil: 'load' });
  await page.waitForFunction(() => Number(document.getElementById('canvas').dataset.triangles) > 0);
  assert.equal(await page.$eval('#canvas', (canvas) => canvas.dataset.body), 'alone');
  // In the middle the body is seen, which moved: blue. The far field, which did not, is pale.
  const [red, , blue, opacity] = await page.evaluate(() => new Promise((done) => {
    document.getElementById('morph-slider').dispatchEvent(new Event('input'));
    requestAnimationFrame(() => {
      const canvas = document.getElementById('canvas');
      const copy = document.createElement('canvas');
      copy.width = canvas.width;
      copy.height = canvas.height;
      const context = copy.getContext('2d');
      context.drawImage(canvas, 0, 0);
      done([...context.getImageData(copy.width / 2, copy.height / 2, 1, 1).data]);
    });
  }));
  assert.ok(opacity === 255 && red < 0.7 * blue, `red ${red}, blue ${blue} in the middle`);
} finally {
  await browser.close();
}
