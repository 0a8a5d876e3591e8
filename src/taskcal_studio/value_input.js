// An input that both the user and the server set. What the user did last stays until the server has answered to that:
// answers to earlier steps come late and would take it back, and so would whatever else of the page is drawn anew meanwhile.
export default {
  props: { value: String, answered: Number, tells: Array },
  emits: ["moved", "left"],
  template: `<input :value="shown" @input="move" @change="leave" @blur="drop">`,
  data() {
    return { shown: this.value, said: 0, typing: false };
  },
  computed: {
    // both at once: the same value as before is an answer, too
    answer() {
      return [this.value, this.answered];
    },
  },
  watch: {
    answer() {
      if (!this.typing && this.answered >= this.said) this.shown = this.value;
    },
  },
  methods: {
    move(event) {
      this.shown = event.target.value;
      this.typing = !this.tells.includes("moved");
      this.say("moved");
    },
    leave(event) {
      this.shown = event.target.value;
      this.typing = false;
      this.say("left");
    },
    // typed, and then typed back to what it was: nothing is said, and what the server has is shown again
    drop() {
      if (!this.typing) return;
      this.typing = false;
      if (this.answered >= this.said) this.shown = this.value;
    },
    say(kind) {
      if (!this.tells.includes(kind)) return;
      this.said += 1;
      this.$emit(kind, { value: this.shown, said: this.said });
    },
  },
};
