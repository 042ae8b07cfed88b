import { defineConfig, type Plugin } from 'vite';
import { fileURLToPath } from 'node:url';
import { notices } from './dev/notices.ts';

// While the page is worked on: where the program, or what stands in for it, listens.
const program = process.env['PROGRAM'] ?? 'http://127.0.0.1:5174';

// Where the built pages go.
const pages = process.env['PAGE'] ?? 'page';

// Two builds into one folder, each with fixed file names so that the same source gives the same bytes: the viewer (a
// page, a script, a style sheet) and the report (one file that opens from disk).
export default defineConfig(({ mode }) => ({
  root: fileURLToPath(new URL('.', import.meta.url)),
  publicDir: mode === 'report' ? false : 'public',
  plugins: mode === 'report' ? [inline_everything()] : [],
  server: { port: 5173, proxy: { '/ws': { target: program, ws: true, changeOrigin: true, rewriteWsOrigin: true } } },
  build: {
    outDir: pages,
    emptyOutDir: mode !== 'report',
    target: 'es2022',
    modulePreload: false as const,
    assetsInlineLimit: 0,
    cssCodeSplit: false,
    rolldownOptions: {
      input: mode === 'report' ? 'report.html' : 'index.html',
      output: {
        entryFileNames: 'viewer.js',
        assetFileNames: 'viewer.[ext]',
        codeSplitting: false,
        postBanner: notices(),
      },
    },
  },
}));

// Puts the report's script and style into its page.
function inline_everything(): Plugin {
  return {
    name: 'inline-everything',
    enforce: 'post',
    generateBundle(_, bundle) {
      const page = bundle['report.html'];
      if (page?.type !== 'asset') throw new Error('report.html was not built');
      let html = String(page.source);
      for (const [name, file] of Object.entries(bundle)) {
        if (file === page) continue;
        const text = file.type === 'chunk' ? file.code : String(file.source);
        const tag =
          file.type === 'chunk' ? /<script[^>]*src="[^"]*viewer\.js"[^>]*><\/script>/ : /<link[^>]*viewer\.css"[^>]*>/;
        if (!tag.test(html)) throw new Error(`the report's page does not name ${name}`);
        html = html.replace(tag, () =>
          file.type === 'chunk'
            ? `<script type="module">${text.replaceAll('</script', '<\\/script')}</script>`
            : `<style>${text}</style>`,
        );
        delete bundle[name];
      }
      page.source = html;
    },
  };
}
