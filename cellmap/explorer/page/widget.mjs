// The page in a frame of a notebook's cell: its messages go through the model of the widget, each with the page's name.

function render({ model, el }) {
  const page = Math.random().toString(36).slice(2);
  let silent = true;
  const channel = {
    readyState: WebSocket.OPEN,
    send: (text) => model.send({ page, text }),
  };
  const heard = (message, buffers) => {
    if (message.page !== page) return;
    if (silent) channel.onopen?.();
    silent = false;
    if (message.closed !== undefined) channel.onclose?.({ reason: message.closed });
    else channel.onmessage?.({ data: buffers?.length ? bytes(buffers[0]) : message.text });
  };
  model.on("msg:custom", heard);
  const frame = document.createElement("iframe");
  Object.assign(frame.style, { width: "100%", height: `${model.get("height")}px`, border: "0" });
  frame.title = "cellmap explorer";
  frame.allow = "clipboard-write";
  frame.cellmapConnect = () => {
    model.send({ page, opened: true });
    return channel;
  };
  frame.srcdoc = model.get("page");
  el.append(frame);
  return () => {
    model.off("msg:custom", heard);
    model.send({ page, closed: true });
  };
}

// Returns a buffer of its own, for views of larger ones begin anywhere.
function bytes(view) {
  if (view instanceof ArrayBuffer) return view;
  return view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength);
}

export default { render };
