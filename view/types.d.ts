// What the page puts on the document for its tests, and for panels that need the page.
interface Document {
  boresight: any;
  comparison: any;
  editor: any;
  report: any;
  space: any;
  study: any;
}
