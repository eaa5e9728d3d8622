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

// The colour in the middle of what the view draws when asked to, and the whole picture.
async function middle(page) {
  return page.evaluate(() => new Promise((done) => {
    document.getElementById('morph-slider').dispatchEvent(new Event('input'));
    requestAnimationFrame(() => {
      const canvas = document.getElementById('canvas');
      const copy = document.createElement('canvas');
      copy.width = canvas.width;
      copy.height = canvas.height;
      const context = copy.getContext('2d');
      context.drawImage(canvas, 0, 0);
      const [red, , blue, opacity] = context.getImageData(copy.width / 2, copy.height / 2, 1, 1).data;
      done({ red, blue, opacity, picture: copy.toDataURL() });
    });
  }));
}

try {
  const page = await browser.newPage();
  page.setDefaultTimeout(0);
  await page.goto(pathToFileURL(file).href, { waitUntil: 'load' });
  await page.waitForFunction(() => Number(document.getElementById('canvas').dataset.triangles) > 0);
  assert.equal(await page.$eval('#canvas', (canvas) => canvas.dataset.body), 'alone');
  // In the middle the body is seen, which moved: blue. The far field, which did not, is pale.
  const above = await middle(page);
  assert.ok(above.opacity === 255 && above.red < 0.7 * above.blue,
    `red ${above.red}, blue ${above.blue} in the middle`);

  // Its underside, the view turned by about half a circle, is as well lit.
  await page.$eval('#canvas', (canvas) => canvas.scrollIntoView());
  const box = await (await page.$('#canvas')).boundingBox();
  const x = box.x + box.width / 2;
  let below = above;
  while (below.picture === above.picture) {
    await page.mouse.move(x, box.y + 0.1 * box.height);
    await page.mouse.down();
    await page.mouse.move(x, box.y + 0.9 * box.height, { steps: 20 });
    await page.mouse.up();
    below = await middle(page);
  }
  assert.ok(below.opacity === 255 && below.blue > 0.6 * above.blue,
    `blue ${above.blue} from above, ${below.blue} from below`);
} finally {
  await browser.close();
}
