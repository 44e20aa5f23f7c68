// Requests for the scanner that is shown, and their answers.

export class Requests {
  /** `send` gets each message for the console. */
  constructor(send) {
    this.send = send;
    this.number = 0;
    this.open = new Map();
  }

  /** Sends a request, and returns its answer. Throws an error with the reason if there is none. */
  ask(request) {
    this.number++;
    const { number } = this;
    return new Promise((resolve, reject) => {
      this.open.set(number, { resolve, reject });
      if (!this.send({ kind: "ask", number, request })) {
        this.open.delete(number);
        reject(new Error("the connection is lost"));
      }
    });
  }

  /** Passes an answer on. */
  told({ number, answer, error }) {
    const asked = this.open.get(number);
    this.open.delete(number);
    if (error === null) {
      asked?.resolve(answer);
    } else {
      asked?.reject(new Error(error));
    }
  }

  /** Gives up the requests of a connection that is lost, or of a scanner that is no longer shown. */
  lost() {
    for (const { reject } of this.open.values()) {
      reject(new Error("the answer was not waited for"));
    }
    this.open.clear();
  }
}

/** Runs an action, and shows why it failed. */
export async function attempt(action) {
  const shown = document.getElementById("panel-error");
  try {
    shown.textContent = "";
    return await action();
  } catch (error) {
    shown.textContent = error.message;
    return null;
  }
}
