// What the page lets tests see, as window.traceflow.
export interface ForTests {
  frames: number; // painted so far
  lastFrame: { view: number; width: number; height: number; final: boolean } | null;
  latencies: number[]; // ms from input to the first frame that shows it
  readonly connected: boolean;
}

declare global {
  interface Window {
    traceflow: ForTests;
  }
}
