// Runs simulations in a worker made from the text of the page; in slices on the page if workers are not allowed.
const LATEST = "unwanted", HERE = 8; // HERE: ms of computation at a time without a worker

export class Mover {
  /** @param {() => any} library returns the functions that a worker needs @param {any} facts */
  constructor(library, facts) {
    this.own = library().begin(facts);
    this.id = 0;
    this.halted = false;
    this.heard = /** @type {any} */ (null);
    try {
      const address = URL.createObjectURL(new Blob([`"use strict";\nconst made = (${library})();\nmade.serve(self, made.begin);\n`], { type: "text/javascript" }));
      this.worker = new Worker(address);
      this.worker.onmessage = ({ data }) => this.hear(data);
      this.worker.onerror = (event) => { // a security policy forbids workers
        event.preventDefault();
        this.worker = null;
        if (this.last) this.here(this.last);
      };
      this.worker.postMessage({ facts });
    } catch {
      this.worker = null;
    }
  }

  /** @param {{id: number, reached?: number, course?: any, fault?: string}} message */
  hear({ id, reached, course, fault }) {
    if (id !== this.id || !this.heard) return;
    if (reached !== undefined) this.heard.told(reached);
    else if (fault) this.heard.failed(new Error(fault));
    else this.heard.done(course);
  }

  /**
   * Promise of the result of a disturbance, which never resolves if another one is requested meanwhile.
   * @param {ArrayLike<number>} values @param {ArrayLike<number>} sigmas @param {any} asked @param {(time: number) => void} told
   */
  run(values, sigmas, asked, told) {
    this.id++;
    this.halted = false;
    return new Promise((done, failed) => {
      this.heard = { done, failed, told };
      this.last = { id: this.id, values: Array.from(values), sigmas: Array.from(sigmas), asked };
      if (this.worker) this.worker.postMessage(this.last);
      else this.here(this.last);
    });
  }

  /** Cancel the present run. */
  forget() {
    this.id++;
    this.heard = null;
    this.worker?.postMessage({ stop: true });
  }

  stop() {
    this.halted = true;
    this.worker?.postMessage({ stop: true });
  }

  async here({ id, values, sigmas, asked }) {
    let began = performance.now();
    const pause = async () => {
      if (performance.now() < began + HERE) return;
      await new Promise((resume) => setTimeout(resume));
      began = performance.now();
    };
    try {
      const course = await this.own.set(values, sigmas).run(asked, () => (this.id !== id ? LATEST : this.halted ? "stopped" : ""), pause, (reached) => this.hear({ id, reached }));
      if (course) this.hear({ id, course });
    } catch (error) {
      this.hear({ id, fault: error instanceof Error ? error.message : String(error) });
    }
  }
}
