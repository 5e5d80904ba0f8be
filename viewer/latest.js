/** At most one request under way; of those that are asked for meanwhile, only the last is made. */
export class Latest {
  #run;
  #isBusy = false;
  /** @type {{value: any} | null} */ #waiting = null;

  /** @param {(value: any) => Promise<void>} run must not throw */
  constructor(run) {
    this.#run = run;
  }

  /** @param {any} value what the next run should be for */
  async ask(value) {
    this.#waiting = { value };
    if (this.#isBusy) return;
    this.#isBusy = true;
    try {
      while (this.#waiting) {
        const { value: next } = this.#waiting;
        this.#waiting = null;
        await this.#run(next);
      }
    } finally {
      this.#isBusy = false;
    }
  }

  /** Forgets what was asked for; what is under way goes on. */
  forget() {
    this.#waiting = null;
  }
}
