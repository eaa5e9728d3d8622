// Opens the overview of a batch from disk in a browser and checks that it sorts and shows variants
// side by side: node overview_test.mjs OVERVIEW.html BROWSER

import assert from 'node:assert/strict';
import { pathToFileURL } from 'node:url';
import puppeteer from 'puppeteer-core';

const [file, browserPath] = process.argv.slice(2);
// The caller limits the time: on a busy machine every step may take long.
const browser = await puppeteer.launch({
  executablePath: browserPath, timeout: 0, protocolTimeout: 0, args: ['--no-sandbox'],
});

async function sortBy(page, name) {
  await page.evaluate((text) => {
    [...document.querySelectorAll('#variants th button')].find((b) => b.textContent === text).click();
  }, name);
  return page.$$eval('#variants tbody tr', (rows) => rows.map((row) => row.dataset.variant));
}

try {
  const page = await browser.newPage();
  page.setDefaultTimeout(0);
  const problems = [];
  page.on('pageerror', (error) => problems.push(`page error: ${error.message}`));
  page.on('request', (request) => {
    if (!/^(file|data|blob):/.test(request.url())) problems.push(`asks for ${request.url()}`);
  });
  await page.goto(pathToFileURL(file).href, { waitUntil: 'load' });

  assert.deepEqual(await sortBy(page, 'variant'), ['base', 'step05', 'step20']);
  assert.deepEqual(await sortBy(page, 'after'), ['step20', 'step05', 'base'], 'by quality, unknown last');
  assert.deepEqual(await sortBy(page, 'after'), ['step05', 'step20', 'base'], 'and the other way');
  const reason = await page.$eval('tr[data-variant="base"] .reason', (cell) => cell.textContent);
  assert.match(reason, /face/, 'a failed variant has its reason');
  const widths = await page.$$eval('#variants img', async (all) => {
    for (const image of all) await image.decode();
    return all.map((image) => image.naturalWidth);
  });
  assert.deepEqual(widths, [400, 400], 'a picture of each result');

  assert.equal(await page.$eval('#compare', (section) => section.hidden), true);
  await page.$eval('tr[data-variant="step05"] input', (box) => box.click());
  await page.$eval('tr[data-variant="step20"] input', (box) => box.click());
  assert.equal(await page.$eval('#compare', (section) => section.hidden), false);
  const names = await page.$$eval('#side-by-side figcaption', (all) => all.map((c) => c.textContent));
  assert.deepEqual(names, ['step05', 'step20']);
  assert.equal(await page.$$eval('#side-by-side img', (all) => all.length), 2);
  assert.deepEqual(problems, []);
} finally {
  await browser.close();
}
