import { open_browser } from './browser.ts';

// Pictures of a report: node .build/dev/report_shots.js FILE FOLDER

const [file = 'out/report.html', folder = 'out/shots'] = process.argv.slice(2);
const browser = await open_browser();
for (const [form, width, height] of [
  ['wide', 1280, 800],
  ['narrow', 390, 844],
] as const) {
  for (const colorScheme of ['dark', 'light'] as const) {
    const page = await browser.newPage({ viewport: { width, height }, colorScheme });
    page.on('pageerror', (error) => console.log(error.message));
    page.on('console', (message) => message.type() === 'error' && console.log(message.text()));
    await page.goto(`file://${file}`);
    await page.waitForTimeout(400);
    await page.screenshot({ path: `${folder}/report-${form}-${colorScheme}.png` });
    await page.screenshot({ path: `${folder}/report-${form}-${colorScheme}-whole.png`, fullPage: true });
    await page.getByTestId('hero-open').click();
    await page.keyboard.press('ArrowRight');
    await page.waitForTimeout(200);
    await page.screenshot({ path: `${folder}/report-${form}-${colorScheme}-large.png` });
    await page.close();
  }
}
const page = await browser.newPage({ colorScheme: 'dark' });
await page.goto(`file://${file}`);
await page.pdf({
  path: `${folder}/report.pdf`,
  format: 'A4',
  margin: { top: '14mm', bottom: '14mm', left: '12mm', right: '12mm' },
});
await browser.close();
