// Bundles the report page's script: node build.mjs OUT.js OUT-licences.txt

import { build } from 'esbuild';
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';

const [script, licences] = process.argv.slice(2);

const result = await build({
  entryPoints: ['main.js'],
  bundle: true,
  minify: true,
  format: 'iife',
  target: 'es2022',
  legalComments: 'none', // the licences are in the page as a whole
  metafile: true,
  write: false,
});
// A page ends at the first closing tag, even within a string of the script.
writeFileSync(script, result.outputFiles[0].text.replaceAll('</script', '<\\/script'));

// The licence of every package a part of which is in the bundle.
const names = new Set();
for (const file of Object.keys(result.metafile.inputs)) {
  const match = file.match(/^node_modules\/((?:@[^/]+\/)?[^/]+)\//);
  if (match) names.add(match[1]);
}
const texts = [...names].sort().map((name) => {
  const folder = `node_modules/${name}`;
  const { version } = JSON.parse(readFileSync(`${folder}/package.json`));
  const files = readdirSync(folder).filter((file) => /^licen[cs]e/i.test(file)).sort();
  if (files.length === 0) throw new Error(`${name} has no licence file`);
  return `${name} ${version}\n\n${readFileSync(`${folder}/${files[0]}`, 'utf8').trim()}\n`;
});
writeFileSync(licences, texts.join('\n----------------------------------------\n\n'));
