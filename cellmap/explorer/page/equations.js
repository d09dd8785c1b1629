// Equations of one's own: typed, or read from a file that is chosen or dropped on the text.

const LONGEST = 10000; // characters; the server reads no more

export class Equations {
  // `use(text)` promises that a text is the system, or fails with its line and column.
  constructor({ form, text, mistake, file }, use) {
    Object.assign(this, { form, text, mistake, use });
    form.addEventListener("submit", (event) => { event.preventDefault(); this.submit(); });
    file.addEventListener("change", () => { this.read(file.files[0]); file.value = ""; });
    text.addEventListener("dragover", (event) => event.preventDefault());
    text.addEventListener("drop", (event) => {
      if (!event.dataTransfer.files.length) return;
      event.preventDefault();
      this.read(event.dataTransfer.files[0]);
    });
  }

  async read(file) {
    if (!file) return;
    if (file.size > LONGEST) {
      this.mistake.textContent = `${file.name} has ${file.size} bytes: take a text of at most ${LONGEST}`;
      return;
    }
    this.text.value = await file.text();
    await this.submit();
  }

  async submit() {
    this.mistake.textContent = "";
    try {
      await this.use(this.text.value);
    } catch (error) {
      this.mistake.textContent = error.message;
      if (error.line) this.point(error.line, error.column);
    }
  }

  // Selects a line of the text from a column on.
  point(line, column) {
    const { text } = this;
    const before = text.value.split("\n").slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
    const end = text.value.indexOf("\n", before);
    text.focus();
    text.setSelectionRange(before + column - 1, end < 0 ? text.value.length : end);
  }
}
