// Opens a report page from disk in a browser without a display, as a user would, and checks that it
// works: node page_test.mjs REPORT.html BROWSER [SCREENSHOT_FOLDER]

import assert from 'node:assert/strict';
import { statSync } from 'node:fs';
import { pathToFileURL } from 'node:url';
import puppeteer from 'puppeteer-core';

const [file, browserPath, screenshots] = process.argv.slice(2);
const desktop = { width: 1280, height: 900 };
const phone = { width: 390, height: 844, deviceScaleFactor: 2, isMobile: true, hasTouch: true };

// Pages by themselves ask for nothing but themselves.
async function openPage(browser, viewport, scheme, problems) {
  const page = await browser.newPage();
  page.setDefaultTimeout(0);
  page.on('pageerror', (error) => problems.push(`page error: ${error.message}`));
  page.on('console', (message) => {
    if (['error', 'warn'].includes(message.type())) problems.push(`console: ${message.text()}`);
  });
  page.on('request', (request) => {
    if (!/^(file|data|blob):/.test(request.url())) problems.push(`asks for ${request.url()}`);
  });
  await page.setViewport(viewport);
  await page.emulateMediaFeatures([{ name: 'prefers-color-scheme', value: scheme }]);
  await page.goto(pathToFileURL(file).href, { waitUntil: 'load' });
  assert.deepEqual(problems, []);
  return page;
}

const dataOf = (page) => page.$eval('#data', (element) => JSON.parse(element.textContent));
const sum = (values) => values.reduce((a, b) => a + b, 0);

async function untilDrawn(page, morph) {
  await page.waitForFunction((value) => {
    const { triangles, morph: drawn } = document.getElementById('canvas').dataset;
    return Number(triangles) > 0 && Math.abs(Number(drawn) - value) < 1e-9;
  }, {}, morph);
}

// What the view draws when asked to: read in the frame that draws it, as a frame later the canvas
// may hold nothing, and a screenshot shows some earlier frame.
async function picture(page) {
  return page.evaluate(() => new Promise((done) => {
    document.getElementById('morph-slider').dispatchEvent(new Event('input'));
    requestAnimationFrame(() => done(document.getElementById('canvas').toDataURL()));
  }));
}

// At the element itself: the page may still move under a mouse.
const click = (page, selector) => page.$eval(selector, (element) => element.click());

async function checkViewer(page, data) {
  await untilDrawn(page, 1);
  const sizes = Buffer.from(data.surface.sizes, 'base64');
  const drawn = await page.$eval('#canvas', (canvas) => Number(canvas.dataset.triangles));
  assert.equal(drawn, sum([...sizes].map((size) => size - 2)), 'all facets are drawn');
  assert.equal(await page.$eval('#canvas', (canvas) => canvas.dataset.body), 'whole');
  const after = await picture(page);

  await page.focus('#morph-slider');
  await page.keyboard.press('Home');
  await untilDrawn(page, 0);
  const before = await picture(page);
  assert.ok(before !== after, 'the slider moves the surface');

  await page.keyboard.press('End');
  await untilDrawn(page, 1);
  assert.ok(await picture(page) === after, 'the slider moves it back');

  for (const name of ['jacobian', 'deviation', 'none']) {
    const last = await picture(page);
    await page.select('#colouring', name);
    await page.waitForFunction((was) => document.getElementById('legend-title').textContent !== was, {},
      name === 'jacobian' ? 'displacement, mm' : 'no such title');
    assert.ok(await picture(page) !== last, `coloured by ${name}`);
  }

  await click(page, 'tr[data-worst="0"]');
  assert.equal(await page.$eval('#show-worst', (box) => box.checked), true, 'a row shows its element');
  assert.equal(await page.$eval('#canvas', (canvas) => canvas.dataset.chosen), '0', 'which is marked');
  const first = await picture(page);
  await click(page, 'tr[data-worst="1"]');
  assert.deepEqual(await page.$$eval('tr.chosen', (rows) => rows.map((row) => row.dataset.worst)), ['1']);
  assert.ok(await picture(page) !== first, 'another element is marked otherwise');
  const ground = await page.$eval('#legend', (legend) => getComputedStyle(legend).backgroundColor);
  assert.doesNotMatch(ground, /(, 0|\/ 0)\)$/, 'the legend has a ground of its own');
}

async function checkTables(page, data) {
  const { report, details } = data;
  const shown = details.scaled_jacobian;
  for (const name of ['before', 'after'])
    assert.equal(sum(shown[name]), report.mesh.cells, `the histogram ${name} counts every element`);
  assert.equal(await page.$$eval('#jacobian-chart svg path', (paths) => paths.length), 4, 'two areas with lines');
  const isExact = sum(details.deviation.before) + sum(details.deviation.after) === 0;
  assert.equal(await page.$('#deviation-chart') === null, isExact, 'no chart of nothing');
  if (isExact) assert.match(await page.$eval('#deviation', (section) => section.textContent), /All surface nodes lie/);
  for (const chart of isExact ? ['jacobian'] : ['jacobian', 'deviation']) {
    const labels = await page.$$eval(`#${chart}-chart .ct-label.ct-horizontal`,
      (all) => all.map((label) => label.textContent));
    assert.ok(labels.length >= 2, 'the axis is labelled');
    assert.equal(new Set(labels).size, labels.length, `no label comes twice: ${labels}`);
  }
  assert.equal(await page.$$eval('#worst tbody tr', (rows) => rows.length), details.worst.length);
  assert.equal(details.worst[0].cell, report.after.worst_cell, 'the worst element comes first');
  const faces = await page.$$eval('#match details:first-of-type tbody tr', (rows) => rows.length);
  assert.equal(faces, report.base_cad.faces, 'every face has its row');
  const images = await page.$$eval('figure img', async (all) => {
    for (const image of all) await image.decode();
    return all.map((image) => image.naturalWidth);
  });
  assert.equal(images.length, 4, 'four pictures');
  assert.ok(images.every((width) => width > 0), 'which are pictures');
  const licences = await page.$eval('footer pre', (element) => element.textContent);
  for (const name of ['three', 'chartist']) assert.match(licences, new RegExp(`^${name} `, 'm'));
}

async function checkWidth(page, width) {
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(wide <= width, `the page is ${wide} pixels wide on a screen of ${width}`);
}

// How bright the page and its text are, 0 to 255.
async function brightness(page) {
  return page.evaluate(() => {
    const mean = (colour) => colour.match(/\d+/g).slice(0, 3).reduce((a, b) => a + Number(b), 0) / 3;
    const style = getComputedStyle(document.body);
    return { ground: mean(style.backgroundColor), ink: mean(style.color) };
  });
}

async function save(page, name) {
  if (screenshots) await page.screenshot({ path: `${screenshots}/${name}.png`, fullPage: true });
}

assert.ok(statSync(file).size < 10e6, 'the page is below 10 MB');
// The caller limits the time: on a busy machine every step may take long.
const browser = await puppeteer.launch({
  executablePath: browserPath,
  timeout: 0,
  protocolTimeout: 0,
  args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
try {
  const problems = [];
  for (const [name, viewport] of Object.entries({ desktop, phone }))
    for (const scheme of ['light', 'dark']) {
      const page = await openPage(browser, viewport, scheme, problems);
      await untilDrawn(page, 1);
      await checkWidth(page, viewport.width);
      const { ground, ink } = await brightness(page);
      assert.ok(scheme === 'dark' ? ink - ground > 120 : ground - ink > 120, `${scheme} is readable`);
      await save(page, `${name}-${scheme}`);
      if (name === 'desktop' && scheme === 'light') {
        const data = await dataOf(page);
        await checkTables(page, data);
        await checkViewer(page, data);
      }
      await page.close();
    }
  assert.deepEqual(problems, []);
} finally {
  await browser.close();
}
