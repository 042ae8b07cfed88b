import { readFileSync } from 'node:fs';

const packages = ['preact', '@preact/signals', '@preact/signals-core', 'uplot'];

// A comment with the licences of the packages that end up in a page.
export function notices(): string {
  const texts = packages.map((name) => {
    const licence = readFileSync(new URL(`../node_modules/${name}/LICENSE`, import.meta.url), 'utf8');
    return `${name}\n\n${licence.trim()}`;
  });
  return `/*! This file holds the packages below.\n\n${texts.join('\n\n\n')}\n*/`;
}
